"""A lag of the drive's current sensors where the estimate without it passes for explained.

The lag acts by the switching alone: the current overshoots its band. A wrong scale or supply, or faults, may
leave no more of the residual as a whole; in the ripple the right lag is seen (`ripple`).
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from emaphm.actuator.laws import LAWS
from emaphm.arrays import Array
from emaphm.diagnosis.selection.law_selection import (
    corrected_fit,
    fit_with_law,
    is_possible,
    with_free_law,
)
from emaphm.diagnosis.selection.ripple import RippleResidual, ripple_powers
from emaphm.diagnosis.selection.supply_scan import is_scanned
from emaphm.estimation.bias_correction import compared
from emaphm.estimation.discrepancy import reference_problem
from emaphm.estimation.methods import Method
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.parameter_space import ParameterSpace
from emaphm.estimation.problem import Problem
from emaphm.estimation.reference.refinement import refine_by_reference
from emaphm.estimation.search_result import SearchResult
from emaphm.random_streams import child_seed, stream

SENSOR_LAG = "sensor-lag"


@dataclass(frozen=True)
class SensorLagSettings:
    """When a lag is suspected; `make study` (limits, plants) measures it.

    Where that of the law's start, 5 µs, leaves less than `tried_share` of the weighted residual that a
    thirtieth of it leaves, all else held. Without a lag it left 1.12 to 4.7 (24 recordings, half of them with
    another supply), with one of 20 µs in whose place a scale had been selected 1.02. It must also show, and
    change the current by more than `visible` of that residual: 0.7 and more there, 0.06 with noise of 0.5 A.
    """

    tried_share: float = 1.1
    visible: float = 0.2


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
        """Return it for an `objective` without the lag, at a `point` (d,) of `space`."""
        law = LAWS[SENSOR_LAG]
        lagging = with_free_law(objective, law, law.parameters)
        with_lag = lagging.space.carried_over(point, space)
        return cls(lagging, with_lag, np.append(with_lag[:-1], lagging.space.lower[-1]))


def can_show_lag(problem: Problem) -> bool:
    """Return whether the switching would show a lag of the current, and none is known."""
    return is_scanned(problem.actuator) and is_possible(problem.actuator, LAWS[SENSOR_LAG])


def is_lag_suspected(result: SearchResult, seed: int) -> bool:
    """Return whether the reference model leaves as little of the ripple with a lag as without it."""
    if not can_show_lag(result.objective.problem):
        return False
    tried = LagComparison.at(result.objective, result.point, result.objective.space)
    points, rng = np.array([tried.with_lag, tried.without]), stream(seed, "reference runs with a lag")
    none, reference = np.zeros_like(tried.objective.target), reference_problem(tried.objective)
    outcomes = compared(tried.objective, none, points, reference, rng)
    with_lag, without = (RippleResidual.of(one) for one in outcomes)
    residuals = (with_lag, without, with_lag.less(without))
    lagging, prompt, effect = ripple_powers(residuals, result.noise_level)
    settings = SENSOR_LAG_SETTINGS
    return bool(lagging < settings.tried_share * prompt and effect > settings.visible * prompt)


def with_sensor_lag(searched: SearchResult, method: Method, max_corrections: int, seed: int) -> SearchResult:
    """Return the estimate with the lag that the reference model prefers, from that without it."""
    law = LAWS[SENSOR_LAG]
    fit = fit_with_law(searched, law, method, child_seed(seed, "lag of the current sensors"))
    return refine_by_reference(corrected_fit(fit, max_corrections, seed), seed)
