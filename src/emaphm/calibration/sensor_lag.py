"""The lag of the current sensors, which the averaged model hardly shows: found by the reference model."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.calibration.campaign import CampaignRow
from emaphm.calibration.description import Description
from emaphm.calibration.findings import LARGEST_ERROR, Parameter, absolute_error
from emaphm.calibration.unit_fit import FitSettings, fitted_parameters, searched
from emaphm.estimation.joint.correction import JointEstimate, corrected_estimate
from emaphm.estimation.reference.scan import CURRENT_LAGS_S, scan

NAME = "current_lag"


@dataclass(frozen=True)
class FoundLag:
    """A description whose lag is set, no longer free, and the lag as a parameter of the result."""

    description: Description
    parameter: Parameter


def found_lag(rows: Sequence[CampaignRow], description: Description, settings: FitSettings) -> FoundLag:
    """Return the lag at which the reference model fits all `rows` best, all other parameters fitted anew."""
    actuator = description.actuator
    free = tuple(name for name in description.free if name != NAME)
    fitted = fitted_parameters(rows, actuator, free)
    start = {name: value for name, value in description.start.items() if name in fitted}

    def evaluate(lag: float) -> JointEstimate:
        nonlocal start
        lagging = with_lumped_parameters(actuator, {NAME: lag})
        found = searched(rows, lagging, fitted, settings, start)
        start = found.start
        return corrected_estimate(found.joint, found.point, settings.max_corrections, settings.seed)

    found = scan(CURRENT_LAGS_S, evaluate, lambda one: one.primary_variance)
    known = found.deviation < LARGEST_ERROR
    deviation = min(found.deviation, math.log(CURRENT_LAGS_S[-1] / CURRENT_LAGS_S[0]))
    parameter = Parameter(found.value, absolute_error(found.value, deviation), "s", known)
    lagging = with_lumped_parameters(actuator, {NAME: found.value})
    return FoundLag(replace(description, actuator=lagging, free=free, start=start), parameter)
