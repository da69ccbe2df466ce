"""Search for the parameters that explain a recording, by any of the methods."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from emaphm.arrays import Array
from emaphm.errors import MethodError, nearest
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.correction_iterations import never
from emaphm.estimation.cost_functions import COST_FUNCTIONS
from emaphm.estimation.discrepancy import has_reference, resolves_switching
from emaphm.estimation.global_search.multistart import descend_from, local_search, multistart
from emaphm.estimation.global_search.population_search import OnBestFaults, population_search
from emaphm.estimation.global_search.restarts import search_with_restarts
from emaphm.estimation.methods import Method
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.search_settings import SearchSettings
from emaphm.progress import Progress, subprogress
from emaphm.random_streams import stream


def search(
    objective: MapObjective,
    settings: SearchSettings,
    *,
    fitness: str,
    on_progress: Progress | None = None,
    on_population: OnBestFaults | None = None,
    starts: Array | None = None,
    is_hopeless: Callable[[SearchResult], bool] = never,
) -> SearchResult:
    """Return the search result of the method of the `settings`; after least squares, the bias is corrected.

    With `starts` (n, d), points near the optimum, least squares begin there without a global stage. If the
    result does not explain the recording, the search is repeated with a global stage, unless switching causes
    a bias that is not corrected. No further search follows a result that `is_hopeless`.

    Raises
    ------
    MethodError
        The fitness is unknown, or the method cannot use this fitness or model.
    """
    method = settings.method
    check_fitness(method, fitness)
    if not method.least_squares:
        return population_search(objective, method, fitness, settings.seed, on_progress, on_population)
    model = objective.problem.model
    if model.switches:
        raise MethodError(
            f"method '{method.name}' needs derivatives, which the {model.name} model's switching makes "
            "useless; use the averaged model, or a method without least squares"
        )
    if settings.max_corrections > 0 and resolves_switching(objective.problem):
        return search_with_restarts(objective, settings, on_progress, starts, is_hopeless)
    result = _single_search(objective, settings, on_progress, starts)
    # The averaged model alone does not reproduce switching: another search would not reduce this residual.
    if starts is None or result.down_to_noise or resolves_switching(objective.problem):
        return result
    repeated = _single_search(objective, settings, None, None)
    return min(result, repeated, key=lambda result: result.residual_variance)


def check_fitness(method: Method, fitness: str) -> None:
    """Raise MethodError if the fitness is unknown or the method cannot minimise it."""
    if fitness not in COST_FUNCTIONS:
        raise MethodError(f"unknown fitness '{fitness}'{nearest(fitness, COST_FUNCTIONS)}")
    if method.least_squares and fitness != "least_squares":
        raise MethodError(
            f"method '{method.name}' minimises least_squares; choose an optimiser alone for fitness "
            f"'{fitness}'"
        )


def _single_search(
    objective: MapObjective,
    settings: SearchSettings,
    on_progress: Progress | None,
    starts: Array | None,
) -> SearchResult:
    """Return the result of one search by least squares, corrected if the reference model has the drive."""
    result = _uncorrected_search(objective, settings, on_progress, starts)
    if settings.max_corrections == 0 or not has_reference(objective.problem):
        return result
    corrected = correct_bias(objective, result.point[np.newaxis], settings.max_corrections, settings.seed)
    return replace(corrected, started=result.started)


def _uncorrected_search(
    objective: MapObjective,
    settings: SearchSettings,
    on_progress: Progress | None,
    starts: Array | None,
) -> SearchResult:
    """Return the result of one search by least squares, without a bias correction."""
    if starts is None:
        progress = subprogress(on_progress, 0.0, 0.8)
        refined = multistart(objective, settings.seed, settings.method.optimizer, progress)
    else:
        refined = descend_from(objective, starts)
    descents = local_search(objective, refined.best, 0.0, stream(settings.seed, "local search"))
    if on_progress is not None:
        on_progress(1.0)
    return replace(SearchResult.at(objective, descents.best), started=starts is not None)
