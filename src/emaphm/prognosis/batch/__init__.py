"""Prognoses of all units of a history, on several workers."""

from emaphm.prognosis.batch.all_units import UnitOutcome, prognose_all

__all__ = ["UnitOutcome", "prognose_all"]
