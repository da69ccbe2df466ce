"""Storage of prognoses in a history, with the curves of their figures."""

from emaphm.prognosis.keeping.curves import Curves
from emaphm.prognosis.keeping.update import earlier_rows, keep_with_curves, update_prognosis

__all__ = ["Curves", "earlier_rows", "keep_with_curves", "update_prognosis"]
