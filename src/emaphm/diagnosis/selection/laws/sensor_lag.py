"""A lag of the drive's current sensors where the residual without it is expected.

The lag acts by the switching alone: the current overshoots its band. A wrong scale or supply, or faults, may
leave no more of the residual as a whole; in the ripple the right lag is seen (`ripple`).
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
"""The lags that are tried first [s]: 2, 8 and 32 µs. The residual is about linear in a lag, so one of the
three leaves two fifths of what any of 2 to 64 µs does, or less."""


@dataclass(frozen=True)
class SensorLagSettings:
    """When a lag is suspected; `make study` (limits, plants) measures it.

    The law's start, 5 µs, changes the weighted residual by a share e of what is left without a lag, and
    leaves 1 + z e of that. If the residual were linear in the lag, z would be 1 without one, 1 - 2 L / 5 µs
    with one of L. It was 0.55 to 1.25 of 24 recordings without (noise of 0.05 to 0.5 A), -0.7 to -1.2 with 5
    to 40 µs, 0.03 with one of 20 µs in whose place a scale had been selected. One of 2 µs would have 0.2.

    Suspected below `least_change`, where it changes more than `visible`: of less, chance decides.
    """

    least_change: float = 0.2
    visible: float = 0.03


SENSOR_LAG_SETTINGS = SensorLagSettings()


@dataclass(frozen=True, eq=False)
class LagComparison:
    """What is minimised with the `objective`'s lag, and points (d,) of it `with_lag` and `without`.

    The lag is the last coordinate; the least one of its range is a sixth of the reference model's step.
    """

    objective: MapObjective
    with_lag: Array
    without: Array

    @classmethod
    def at(cls, objective: MapObjective, point: Array, space: ParameterSpace) -> Self:
        """Return the comparison for an `objective` without the lag, at a `point` (d,) of `space`."""
        law = LAWS[SENSOR_LAG]
        lagging = with_free_law(objective, law, law.parameters)
        with_lag = lagging.space.carried_over(point, space)
        return cls(lagging, with_lag, np.append(with_lag[:-1], lagging.space.lower[-1]))


def can_show_lag(problem: Problem) -> bool:
    """Return whether the switching would show a lag of the current, and none is known.

    Not of a unit whose model error was learned: what the model leaves of its ripple is no lag's alone.
    """
    actuator = problem.actuator
    learned = any(actuator.model_error.of(name) for name in problem.channels)
    return is_scanned(actuator) and not learned and LAWS[SENSOR_LAG].is_possible(actuator)


def is_lag_suspected(result: SearchResult, seed: int) -> bool:
    """Return whether the reference model leaves so little of the ripple with a lag that there may be one."""
    if not can_show_lag(result.objective.problem):
        return False
    tried = LagComparison.at(result.objective, result.point, result.objective.space)
    points, rng = np.array([tried.with_lag, tried.without]), stream(seed, "reference runs with a lag")
    none, reference = np.zeros_like(tried.objective.target), reference_problem(tried.objective)
    outcomes = compared(tried.objective, none, points, reference, rng)
    with_lag, without = (RippleResidual.of(one) for one in outcomes)
    residuals = (with_lag, without, with_lag.less(without))
    return answer_to_lag(ripple_powers(residuals, result.noise_level)) < SENSOR_LAG_SETTINGS.least_change


def answer_to_lag(powers: Array) -> float:
    """Return z (`SensorLagSettings`), by what is left with a lag, without, and of their difference, (3,).

    No number where the lag does not show.
    """
    lagging, prompt, effect = powers
    if effect <= SENSOR_LAG_SETTINGS.visible * prompt:
        return math.nan
    return float((lagging - prompt) / effect)


def with_sensor_lag(
    searched: SearchResult, before: SearchResult, settings: SearchSettings
) -> SearchResult | None:
    """Return the estimate with the lag that the reference model prefers, from that `searched` without it.

    None where no lag is as good as none, in the estimate `before`.
    """
    fit = fit_with_law(searched, LAWS[SENSOR_LAG], settings.child("lag of the current sensors"))
    found = with_best_lag(fit, before, settings)
    return None if found is None else refine_by_reference(found, settings.seed)


def with_best_lag(fit: Fit, before: SearchResult, settings: SearchSettings) -> SearchResult | None:
    """Return the estimate with the lag that the reference model prefers to the estimate `before` it.

    None where no lag is as good. The residual falls towards a lag that is there, and rises beyond: if a
    longer one leaves more than the least that is tried, the lag is hardly longer than that, and such a one
    must leave as much less than the estimate before as any law must. Where that explains nothing, one of the
    lags that are tried first must leave clearly less.
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
    least, longer, longest = (one.residual_variance for one in probed)
    if longer > least > LAW_SELECTION.share * before.residual_variance:
        return None
    shown = min(least, longer, longest) <= LAW_SELECTION.clearly_less * before.residual_variance
    if not (shown or before.residual_is_expected):
        return None
    found = scan(CURRENT_LAGS_S, with_lag, lambda one: one.residual_variance, workers)
    # The value is anywhere between its neighbours: evenly so, a third of the square of the way to one.
    away = np.array([one.point - found.estimate.point for one in found.neighbours])
    between = away.T @ away / (3 * len(away))
    return replace(found.estimate, scatter=found.estimate.scatter + between)
