"""The search for a chirp of higher predicted precision, and the choice among the best by simulation."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from emaphm.arrays import Array
from emaphm.errors import SignalError
from emaphm.experiment.constraints import Constraints
from emaphm.experiment.excitation import Excitation
from emaphm.experiment.predicted_precision import Precision, predicted_precision
from emaphm.experiment.simulated_tests import SimulatedTests, simulate_tests
from emaphm.experiment.test_setup import TestSetup
from emaphm.optimizers import space_filling
from emaphm.progress import Progress
from emaphm.random_streams import child_seed

FEWEST_TESTS = 4
"""Simulated tests below which a standard error over them is no measure of chance."""


@dataclass(frozen=True)
class CandidateSearchSettings:
    """How chirps are tried, in shares of the constraints: amplitude, first and last frequency.

    `box_sizes` are half the size of the box around the best chirp in each round. No amplitude or last
    frequency is below `least_share`. The `finalists` are the best of the search, `separation` apart at least;
    simulated tests choose one of them, as no search of the averaged model foresees how the models differ.
    """

    box_sizes: tuple[float, ...] = (1.0, 0.4, 0.15)
    least_share: float = 0.1
    finalists: int = 4
    separation: float = 0.15


CANDIDATES = CandidateSearchSettings()


@dataclass(frozen=True, eq=False)
class PlannedTest:
    """An excitation, its `predicted` precision, and the results of simulated tests, if there were any."""

    excitation: Excitation
    predicted: Precision
    simulated: SimulatedTests | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return the planned test for JSON."""
        simulated = self.simulated
        return {
            "manoeuvre": self.excitation.to_dict(),
            "expected": self.predicted.half_widths,
            "proven": None if simulated is None else simulated.precision.half_widths,
            "median_error_percent": None if simulated is None else simulated.median_error,
        }


def search_candidates(
    setup: TestSetup,
    constraints: Constraints,
    given: PlannedTest,
    faults: Array,
    candidates: int,
    seed: int,
    on_progress: Progress | None,
) -> list[PlannedTest]:
    """Return the finalists: chirps of higher predicted precision than the `given` test, the best first."""
    tried: list[tuple[float, Array, PlannedTest]] = []
    lower = np.array([CANDIDATES.least_share, 0.0, CANDIDATES.least_share])
    rounds = np.array_split(np.arange(candidates), len(CANDIDATES.box_sizes))
    for turn, (size, members) in enumerate(zip(CANDIDATES.box_sizes, rounds, strict=True)):
        if not members.size:
            continue
        middle = min(tried, key=lambda one: one[0])[1] if tried else np.ones(3)
        low, high = np.maximum(middle - size, lower), np.minimum(middle + size, 1.0)
        box_seed = child_seed(seed, "candidates", turn)
        for number, shares in zip(members, space_filling(members.size, low, high, box_seed), strict=True):
            planned = _planned(setup, constraints.chirp(shares), faults, seed)
            if planned is not None:
                tried.append((float(planned.predicted.logarithms.mean()), shares, planned))
            if on_progress is not None:
                on_progress((number + 1) / candidates)
    chosen: list[tuple[Array, PlannedTest]] = []
    for value, shares, planned in sorted(tried, key=lambda one: one[0]):
        near = any(np.linalg.norm(shares - other) < CANDIDATES.separation for other, _ in chosen)
        better = value < given.predicted.logarithms.mean()
        if better and not near and len(chosen) < CANDIDATES.finalists:
            chosen.append((shares, planned))
    return [planned for _, planned in chosen]


def choose_finalist(
    setup: TestSetup,
    finalists: Sequence[PlannedTest],
    tests: int,
    seed: int,
    on_progress: Progress | None,
) -> PlannedTest | None:
    """Return the finalist with the narrowest intervals in simulated tests, half as many as `tests`."""
    if len(finalists) < 2:
        return finalists[0] if finalists else None
    few = max(tests // 2, FEWEST_TESTS)
    excitations = [planned.excitation for planned in finalists]
    results = simulate_tests(setup, excitations, few, seed, on_progress)
    return finalists[int(np.argmin([one.precision.logarithms.mean() for one in results]))]


def _planned(setup: TestSetup, excitation: Excitation, faults: Array, seed: int) -> PlannedTest | None:
    """Return the planned test of `excitation`, None where it is too small to move the actuator."""
    try:
        return PlannedTest(excitation, predicted_precision(setup, excitation, faults, seed))
    except SignalError:
        return None
