"""Search for a chirp of higher predicted precision, and choice among the best chirps by simulated tests."""

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
"""Least number of simulated tests for a meaningful standard error over them."""


@dataclass(frozen=True)
class CandidateSearchSettings:
    """Settings of the search for chirps; amplitude, first and last frequency are shares of the constraints.

    `box_sizes` are half the sizes of the box around the best chirp in each round. Amplitude and last
    frequency are at least `least_share`. The `finalists` best chirps, with distances of at least
    `separation`, are compared by simulated tests, because a search with the averaged model cannot predict
    the effect of its differences from the reference model.
    """

    box_sizes: tuple[float, ...] = (1.0, 0.4, 0.15)
    least_share: float = 0.1
    finalists: int = 4
    separation: float = 0.15


CANDIDATES = CandidateSearchSettings()


@dataclass(frozen=True, eq=False)
class PlannedTest:
    """Excitation with its `predicted` precision, and the results of `simulated` tests, if any."""

    excitation: Excitation
    predicted: Precision
    simulated: SimulatedTests | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return the planned test in the form of the JSON output."""
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
    """Return the finalists, chirps of higher predicted precision than the `given` test, best first.

    `candidates` chirps are evaluated under each of `faults` (n, 8).
    """
    tried: list[tuple[float, Array, PlannedTest]] = []
    lower = np.array([CANDIDATES.least_share, 0.0, CANDIDATES.least_share])
    rounds = np.array_split(np.arange(candidates), len(CANDIDATES.box_sizes))
    for number_of_round, (size, members) in enumerate(zip(CANDIDATES.box_sizes, rounds, strict=True)):
        if not members.size:
            continue
        middle = min(tried, key=lambda trial: trial[0])[1] if tried else np.ones(3)
        low, high = np.maximum(middle - size, lower), np.minimum(middle + size, 1.0)
        box_seed = child_seed(seed, "candidates", number_of_round)
        for number, shares in zip(members, space_filling(members.size, low, high, box_seed), strict=True):
            planned = _planned(setup, constraints.chirp(shares), faults, seed)
            if planned is not None:
                tried.append((float(planned.predicted.logarithms.mean()), shares, planned))
            if on_progress is not None:
                on_progress((number + 1) / candidates)
    chosen: list[tuple[Array, PlannedTest]] = []
    for value, shares, planned in sorted(tried, key=lambda trial: trial[0]):
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
    """Return the finalist with the narrowest intervals in `tests` / 2 simulated tests, None without any."""
    if len(finalists) < 2:
        return finalists[0] if finalists else None
    few = max(tests // 2, FEWEST_TESTS)
    excitations = [planned.excitation for planned in finalists]
    results = simulate_tests(setup, excitations, few, seed, on_progress)
    return finalists[int(np.argmin([result.precision.logarithms.mean() for result in results]))]


def _planned(setup: TestSetup, excitation: Excitation, faults: Array, seed: int) -> PlannedTest | None:
    """Return the planned test of `excitation`; None if it is too small to move the actuator."""
    try:
        return PlannedTest(excitation, predicted_precision(setup, excitation, faults, seed))
    except SignalError:
        return None
