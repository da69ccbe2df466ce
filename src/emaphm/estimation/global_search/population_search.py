"""Search by a population method alone, as in the thesis: it minimises a cost of the primary channel."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.cost_functions import COST_FUNCTIONS
from emaphm.estimation.methods import Method
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult
from emaphm.optimizers import BestSoFar
from emaphm.progress import Progress
from emaphm.random_streams import child_seed

OnBestFaults: TypeAlias = Callable[[int, float, Array], None]
"""Called after each population: evaluations so far, least cost so far, its normalised faults (8,)."""


def population_search(
    objective: MapObjective,
    method: Method,
    fitness: str,
    seed: int,
    on_progress: Progress | None,
    on_population: OnBestFaults | None,
) -> SearchResult:
    """Return the best point of all points that the method's optimiser evaluated.

    `fitness` is a name in `COST_FUNCTIONS`.
    """
    assert method.optimizer is not None  # noqa: S101 - only `hybrid` has none, with least squares
    problem, space = objective.problem, objective.space
    optimizer = method.optimizer(np.zeros(space.dimensions), np.ones(space.dimensions))
    cost_function = COST_FUNCTIONS[fitness]

    def cost(unit: Array) -> Array:
        signals = objective.primary_outputs(space.prior_transform(unit))
        return cost_function(problem.recorded, signals, problem.inputs.interval)

    def report(best_so_far: BestSoFar) -> None:
        if on_progress is not None:
            on_progress(min(best_so_far.evaluations / optimizer.budget, 1.0))
        if on_population is not None:
            best = space.faults(space.prior_transform(best_so_far.best_point[np.newaxis]))[0]
            on_population(best_so_far.evaluations, best_so_far.best_fitness, best)

    callback = report if on_progress or on_population else None
    optimum = optimizer.minimise(cost, child_seed(seed, "population"), callback)
    point = space.prior_transform(optimum.point[np.newaxis])[0]
    return SearchResult.at(objective, point, population_cost=optimum.fitness)
