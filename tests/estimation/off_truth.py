"""Search results at a given distance from the truth, with their discrepancy by the reference model."""

import numpy as np
from numpy.typing import ArrayLike

from cases import THESIS, reference_recordings
from emaphm.arrays import Array
from emaphm.estimation.bias_correction import with_discrepancy
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.space.parameter_space import ParameterSpace


def objective_of(truth: Array, duration: float = 0.5) -> MapObjective:
    """Return the objective for the faults of a noisy recording of the reference model."""
    recording = reference_recordings([truth], noise=0.05, duration=duration)[0]
    return MapObjective.of(problem_of(recording, THESIS), ParameterSpace.of(THESIS))


def result_off(objective: MapObjective, truth: ArrayLike, distance: float) -> SearchResult:
    """Return the result at a point whose every coordinate is at a `distance` from the `truth`."""
    signs = np.random.default_rng(3).choice([-1.0, 1.0], 8)
    point = objective.space.project(objective.space.points(truth) + distance * signs)
    return with_discrepancy(SearchResult.at(objective, point), seed=0)
