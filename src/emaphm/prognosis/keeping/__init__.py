"""Prognoses that are kept in a history, with the curves that their figures are drawn from."""

from emaphm.prognosis.keeping.curves import Curves
from emaphm.prognosis.keeping.update import update_prognosis

__all__ = ["Curves", "update_prognosis"]
