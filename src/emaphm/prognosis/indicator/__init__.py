"""Remaining useful life from a user-defined health indicator: any number with variance and limit."""

from emaphm.prognosis.indicator.prognosis import IndicatorPrognosis, prognose_indicator
from emaphm.prognosis.indicator.readings import Indicator, Reading

__all__ = ["Indicator", "IndicatorPrognosis", "Reading", "prognose_indicator"]
