"""Lag of the current sensors, estimated with the reference model.

The lag has little effect in the averaged model. For the same reason, the reference model decides in an
automatic choice of laws whether there is a lag.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from emaphm.actuator.laws import LAWS
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.calibration.campaign import CampaignRow
from emaphm.calibration.description import Description
from emaphm.calibration.findings import LARGEST_ERROR, Parameter, absolute_error
from emaphm.calibration.reference_laws.costs import reference_costs
from emaphm.calibration.unit_fit import FitSettings, fitted_parameters, searched
from emaphm.estimation.joint.correction import JointEstimate, can_be_compared, corrected_estimate
from emaphm.estimation.reference.scan import CURRENT_LAGS_S, scan

NAME = "current_lag"

SHOWN = 0.9
"""Ratio of the mean squared residuals with the best lag and without a lag, other parameters unchanged, below
which a lag is added. The ratio of healthy plants with lags of 5 and 20 µs was 0.64 to 0.88 (28 fits), that of
plants without lag, also with other friction or another back-EMF, 0.92 to 1.1 (30 fits). Plants with a
compliant shaft had 0.87 and more: the shaft is therefore tested first, and with a shaft no lag is tested."""


@dataclass(frozen=True)
class FoundLag:
    """Description with a fixed lag, which is no longer free, and the lag as a parameter of the result."""

    description: Description
    parameter: Parameter


def with_lag_that_shows(
    rows: Sequence[CampaignRow], description: Description, settings: FitSettings
) -> Description:
    """Return the description, with a lag of the current sensors if the reference model indicates one.

    A description with a compliant shaft is returned unchanged.
    """
    law, prompt = LAWS["sensor-lag"], description.actuator
    if not settings.max_corrections or prompt.transmission is not None or not law.is_possible(prompt):
        return description
    by_row = replace(settings, every_row=True)
    fitted = fitted_parameters(rows, prompt, description.free)
    without = searched(rows, prompt, fitted, by_row, description.start)
    if not can_be_compared(without.joint):
        return description
    lagging = law.added_to(prompt)
    variation = by_row.variation(lagging, fitted)

    def cost(lag: float) -> float:
        actuator = with_lumped_parameters(lagging, {NAME: lag})
        joint = by_row.objective(rows, actuator, variation)
        return reference_costs(joint, [without.point], settings.seed)[0]

    (before,) = reference_costs(without.joint, [without.point], settings.seed)
    share = min(cost(lag) for lag in CURRENT_LAGS_S) / before
    if share >= SHOWN:
        return description
    note = (
        f"The current sensors lag, by the reference model: a lag reduces the mean squared residual to "
        f"{100 * share:.2g} %. The lag has little effect in the averaged model, which compares the laws."
    )
    return replace(
        description,
        actuator=lagging,
        free=(*description.free, NAME),
        laws=(*description.laws, law),
        law_notes=(*description.law_notes, note),
    )


def found_lag(rows: Sequence[CampaignRow], description: Description, settings: FitSettings) -> FoundLag:
    """Return the lag with the best fit of the reference model to all `rows`; all parameters are refitted."""
    actuator = description.actuator
    free = tuple(name for name in description.free if name != NAME)
    fitted = fitted_parameters(rows, actuator, free)
    start = {name: value for name, value in description.start.items() if name in fitted}

    def evaluate(lag: float) -> JointEstimate:
        nonlocal start
        lagging = with_lumped_parameters(actuator, {NAME: lag})
        unit = searched(rows, lagging, fitted, settings, start)
        start = unit.start
        return corrected_estimate(unit.joint, unit.point, settings.max_corrections, settings.seed)

    best = scan(CURRENT_LAGS_S, evaluate, lambda estimate: estimate.primary_variance)
    known = best.deviation < LARGEST_ERROR
    deviation = min(best.deviation, math.log(CURRENT_LAGS_S[-1] / CURRENT_LAGS_S[0]))
    parameter = Parameter(best.value, absolute_error(best.value, deviation), "s", known)
    lagging = with_lumped_parameters(actuator, {NAME: best.value})
    return FoundLag(replace(description, actuator=lagging, free=free, start=start), parameter)
