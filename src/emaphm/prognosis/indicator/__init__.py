"""The remaining useful life by a health indicator of one's own: any number with variance and limit."""

from emaphm.prognosis.indicator.prognosis import IndicatorPrognosis, prognose_indicator
from emaphm.prognosis.indicator.readings import Indicator, Reading

__all__ = ["Indicator", "IndicatorPrognosis", "Reading", "prognose_indicator"]
