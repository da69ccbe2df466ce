"""How many simulations an estimate took, counted where they are run."""

import threading
from collections import Counter
from dataclasses import dataclass, field

from emaphm.simulation import REFERENCE, Model

COUNTING = threading.Lock()
"""Held by the one thread that counts."""


@dataclass(frozen=True, eq=False)
class RunCounts:
    """Simulations run so far, by the model's name; all problems made from one share its counts.

    The only thing in an estimation that changes with use: it counts in one place what else every function
    would have to return.
    """

    by_model: Counter[str] = field(default_factory=Counter)

    def add(self, model: Model, runs: int) -> None:
        """Count `runs` simulations of `model`."""
        with COUNTING:
            self.by_model[model.name] += runs

    def of(self, fitted: Model) -> tuple[int, int]:
        """Return the runs of the `fitted` model, and those of the reference model that correct it."""
        corrections = 0 if fitted is REFERENCE else self.by_model[REFERENCE.name]
        return self.by_model[fitted.name], corrections
