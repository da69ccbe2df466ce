"""Number of simulations of an estimation."""

import threading
from collections import Counter
from dataclasses import dataclass, field

from emaphm.simulation import REFERENCE, Model

_COUNT_LOCK = threading.Lock()


@dataclass(frozen=True, eq=False)
class RunCounts:
    """Number of simulations so far, by the model's name; all problems derived from one problem share it.

    It is the only mutable object of an estimation: otherwise every function would have to return a count.
    """

    by_model: Counter[str] = field(default_factory=Counter)

    def add(self, model: Model, runs: int) -> None:
        """Count `runs` simulations of `model`."""
        with _COUNT_LOCK:
            self.by_model[model.name] += runs

    def of(self, fitted: Model) -> tuple[int, int]:
        """Return the number of runs of the `fitted` model, and of the reference model for its correction."""
        corrections = 0 if fitted is REFERENCE else self.by_model[REFERENCE.name]
        return self.by_model[fitted.name], corrections
