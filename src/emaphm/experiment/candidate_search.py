"""The search for a chirp of which more is expected, and the choice among the best by simulated tests."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from emaphm.arrays import Array
from emaphm.errors import SignalError
from emaphm.experiment.constraints import Limits
from emaphm.experiment.excitation import Manoeuvre
from emaphm.experiment.predicted_precision import Widths, expected
from emaphm.experiment.simulated_tests import Proven, prove
from emaphm.experiment.test_setup import Conditions
from emaphm.optimizers.space_filling import space_filling
from emaphm.progress import Progress

SHRINK = (1.0, 0.4, 0.15)
"""Half the size of the box about the best chirp in each round of the search, as a share of the limits."""

LEAST_SHARE = 0.1
"""Least amplitude and last frequency tried, as shares of their limits."""

FINALISTS = 4
"""Best of the search, of which simulated tests choose one: what the models differ by no search foresees."""

APART = 0.15
"""Least distance of two finalists, in shares of the limits: their likes would do alike."""

FEWEST_TESTS = 4
"""Below, a standard error over the tests is no measure of chance."""


@dataclass(frozen=True, eq=False)
class Plan:
    """A manoeuvre, the interval widths `expected` of it, and what simulated tests made of it, if any."""

    manoeuvre: Manoeuvre
    expected: Widths
    proven: Proven | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return the plan for JSON."""
        return {
            "manoeuvre": self.manoeuvre.to_dict(),
            "expected": self.expected.half_widths,
            "proven": None if self.proven is None else self.proven.widths.half_widths,
            "median_error_percent": None if self.proven is None else self.proven.median_error,
        }


def search(
    conditions: Conditions,
    limits: Limits,
    given: Plan,
    faults: Array,
    candidates: int,
    seed: int,
    on_progress: Progress | None,
) -> list[Plan]:
    """Return up to `FINALISTS` chirps of which more is expected than of what was `given`, the best first."""
    tried: list[tuple[float, Array, Plan]] = []
    lower = np.array([LEAST_SHARE, 0.0, LEAST_SHARE])
    rounds = np.array_split(np.arange(candidates), len(SHRINK))
    for turn, (size, members) in enumerate(zip(SHRINK, rounds, strict=True)):
        if not members.size:
            continue
        middle = min(tried, key=lambda one: one[0])[1] if tried else np.ones(3)
        low, high = np.maximum(middle - size, lower), np.minimum(middle + size, 1.0)
        for number, shares in zip(members, space_filling(members.size, low, high, seed + turn), strict=True):
            plan = _plan(conditions, limits.chirp(shares), faults, seed)
            if plan is not None:
                tried.append((float(plan.expected.logarithms.mean()), shares, plan))
            if on_progress is not None:
                on_progress((number + 1) / candidates)
    chosen: list[tuple[Array, Plan]] = []
    for value, shares, plan in sorted(tried, key=lambda one: one[0]):
        near = any(np.linalg.norm(shares - other) < APART for other, _ in chosen)
        if value < given.expected.logarithms.mean() and not near and len(chosen) < FINALISTS:
            chosen.append((shares, plan))
    return [plan for _, plan in chosen]


def choose(
    conditions: Conditions, finalists: Sequence[Plan], tests: int, seed: int, on_progress: Progress | None
) -> Plan | None:
    """Return the finalist whose simulated tests, half of the `tests`, have the narrowest intervals."""
    if len(finalists) < 2:
        return finalists[0] if finalists else None
    few = max(tests // 2, FEWEST_TESTS)
    results = prove(conditions, [plan.manoeuvre for plan in finalists], few, seed, on_progress)
    return finalists[int(np.argmin([one.widths.logarithms.mean() for one in results]))]


def _plan(conditions: Conditions, manoeuvre: Manoeuvre, faults: Array, seed: int) -> Plan | None:
    """Return what to expect of `manoeuvre`, nothing where it is too small to move the actuator."""
    try:
        return Plan(manoeuvre, expected(conditions, manoeuvre, faults, seed))
    except SignalError:
        return None
