"""A lag of the drive's current sensors where the estimate without it passes for explained.

The lag acts by the switching alone: the current overshoots its band. A wrong scale or supply, or faults, may
leave no more of the residual as a whole; in the ripple the right lag is seen (`ripple`).
"""

from dataclasses import dataclass

import numpy as np

from emaphm.actuator.laws import LAWS
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


def is_lag_suspected(result: SearchResult, seed: int) -> bool:
    """Return whether the reference model leaves as little of the ripple with a lag as without it."""
    problem, law = result.objective.problem, LAWS[SENSOR_LAG]
    if not is_scanned(problem.actuator) or not is_possible(problem.actuator, law):
        return False
    objective = with_free_law(result.objective, law, law.parameters)
    point = objective.space.carried_over(result.point, result.objective.space)
    # The lag is the last coordinate; the least one of its range is a sixth of the reference model's step.
    points, rng = np.array([point, point]), stream(seed, "reference runs with a lag")
    points[1, -1] = objective.space.lower[-1]
    outcomes = compared(objective, np.zeros_like(objective.target), points, reference_problem(objective), rng)
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
