"""Estimation of a lag of the drive's current sensors, also if the residual without it is expected.

The lag acts through the switching alone: the current overshoots its band. A wrong scale or supply, or faults,
may give an equal residual; the ripple identifies the right lag (`ripple`).
"""

import math
from dataclasses import dataclass, replace
from functools import cache
from typing import Self

import numpy as np

from emaphm.actuator.laws import LAWS
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.arrays import Array
from emaphm.diagnosis.selection.laws.law_fit import Fit, fit_with_law, with_free_law
from emaphm.diagnosis.selection.ripple import RippleResidual, ripple_powers
from emaphm.diagnosis.selection.settings import LAW_SELECTION
from emaphm.diagnosis.selection.supply.supply_scan import is_scanned
from emaphm.estimation.bias_correction import compared
from emaphm.estimation.discrepancy import reference_problem
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.problem import Problem
from emaphm.estimation.reference.refinement import refine_by_reference
from emaphm.estimation.reference.scan import CURRENT_LAGS_S, scan
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.search_settings import SearchSettings
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.random_streams import stream
from emaphm.threads import in_threads

SENSOR_LAG = "sensor-lag"

PROBED_LAGS_S = CURRENT_LAGS_S[0], CURRENT_LAGS_S[4], CURRENT_LAGS_S[8]
"""Lags that are tried first [s]: 2, 8 and 32 µs. The residual is about linear in the lag, so with one of
the three at most two fifths of the effect of any lag of 2 to 64 µs remain."""


@dataclass(frozen=True)
class SensorLagSettings:
    """Limits for suspecting a lag; `make study` (limits, plants) measures the effect.

    The starting value of the law, 5 µs, changes the weighted residual by a share e of the residual without a
    lag, and 1 + z e of that residual remains. If the residual were linear in the lag, z would be 1 without a
    lag and 1 - 2 L / 5 µs with a lag L. It was 0.55 to 1.25 in 24 recordings without a lag (noise of 0.05 to
    0.5 A), -0.7 to -1.2 with 5 to 40 µs, and 0.03 with a lag of 20 µs in whose place a scale had been
    selected. A lag of 2 µs would have 0.2.

    A lag is suspected if z is below `least_change` and e above `visible`; for smaller e, z is random.
    """

    least_change: float = 0.2
    visible: float = 0.03


SENSOR_LAG_SETTINGS = SensorLagSettings()


@dataclass(frozen=True, eq=False)
class LagComparison:
    """An `objective` with a lag, and its points (d,) `with_lag` and `without`.

    The lag is the last coordinate. `without` has its lower bound, a sixth of the reference model's step.
    """

    objective: MapObjective
    with_lag: Array
    without: Array

    @classmethod
    def at(cls, objective: MapObjective, point: Array, space: ParameterSpace) -> Self:
        """Return the comparison from an `objective` without the lag, at a `point` (d,) of `space`."""
        law = LAWS[SENSOR_LAG]
        lagging = with_free_law(objective, law, law.parameters)
        with_lag = lagging.space.carried_over(point, space)
        return cls(lagging, with_lag, np.append(with_lag[:-1], lagging.space.lower[-1]))


def can_show_lag(problem: Problem) -> bool:
    """Return whether an unknown lag of the current is identifiable from the switching.

    This is not the case for a unit whose model error was learned: the residual of its ripple has other
    causes.
    """
    actuator = problem.actuator
    learned = any(actuator.model_error.of(name) for name in problem.channels)
    return is_scanned(actuator) and not learned and LAWS[SENSOR_LAG].is_possible(actuator)


def is_lag_suspected(result: SearchResult, seed: int) -> bool:
    """Return whether the ripple's residual by the reference model indicates a lag."""
    if not can_show_lag(result.objective.problem):
        return False
    comparison = LagComparison.at(result.objective, result.point, result.objective.space)
    objective, points = comparison.objective, np.array([comparison.with_lag, comparison.without])
    rng = stream(seed, "reference runs with a lag")
    outcomes = compared(objective, points, reference_problem(objective), rng)
    with_lag, without = (RippleResidual.of(outcome) for outcome in outcomes)
    residuals = (with_lag, without, with_lag.less(without))
    return answer_to_lag(ripple_powers(residuals, result.noise_level)) < SENSOR_LAG_SETTINGS.least_change


def answer_to_lag(powers: Array) -> float:
    """Return z (`SensorLagSettings`) from the powers (3,) with a lag, without, and of their difference.

    nan if the effect of the lag is not visible.
    """
    lagging, prompt, effect = powers
    if effect <= SENSOR_LAG_SETTINGS.visible * prompt:
        return math.nan
    return float((lagging - prompt) / effect)


def with_sensor_lag(
    searched: SearchResult, before: SearchResult, settings: SearchSettings
) -> SearchResult | None:
    """Return the estimate with the best lag by the reference model, from the estimate `searched` without.

    None if the estimate `before`, without a lag, is better (`with_best_lag`).
    """
    fit = fit_with_law(searched, LAWS[SENSOR_LAG], settings.child("lag of the current sensors"))
    estimate = with_best_lag(fit, before, settings)
    return None if estimate is None else refine_by_reference(estimate, settings.seed)


def with_best_lag(fit: Fit, before: SearchResult, settings: SearchSettings) -> SearchResult | None:
    """Return the estimate with the best lag by the reference model; None if `before`, without lag, is better.

    The residual falls towards the true lag and rises beyond it. If the second of the lags that are tried
    first has a larger residual than the shortest one, the true lag is hardly longer than the shortest one,
    and the residual with the shortest lag must fall below the limit for any law. If the estimate before does
    not explain the recording, the residual with one of the lags that are tried first must be clearly smaller.
    """
    child = settings.child("law selection, corrected", fit.name)

    @cache
    def with_lag(lag: float) -> SearchResult:
        problem = fit.objective.problem
        lagging = with_lumped_parameters(problem.actuator, {"current_lag": lag})
        objective = replace(fit.objective, problem=replace(problem, actuator=lagging))
        return replace(fit, objective=objective).corrected(child)

    workers = fit.objective.problem.workers
    probed = in_threads(with_lag, PROBED_LAGS_S, workers)
    shortest, medium, longest = (estimate.residual_variance for estimate in probed)
    if medium > shortest > LAW_SELECTION.share * before.residual_variance:
        return None
    is_clearly_smaller = (
        min(shortest, medium, longest) <= LAW_SELECTION.clearly_less * before.residual_variance
    )
    if not (is_clearly_smaller or before.residual_is_expected):
        return None
    scanned = scan(CURRENT_LAGS_S, with_lag, lambda estimate: estimate.residual_variance, workers)
    # The value is uniformly distributed between its neighbours: a third of the squared distance to one.
    differences = np.array([estimate.point - scanned.estimate.point for estimate in scanned.neighbours])
    spacing_covariance = differences.T @ differences / (3 * len(differences))
    return replace(scanned.estimate, scatter=scanned.estimate.scatter + spacing_covariance)
