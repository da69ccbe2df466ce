"""The lag of the current sensors, which the averaged model hardly shows: found by the reference model.

Where laws are chosen, the reference model is asked for the same reason whether there is one.
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
"""Share of the mean squared residual that the best lag leaves, all else being as without one, below which
there is one. Healthy plants with lags of 5 and 20 µs left 0.64 to 0.88 (28 fits), those with none, or with
other friction or another back-EMF, 0.92 to 1.1 (30). A shaft that gives leaves 0.87 and more: it is asked for
before, and where there is one, a lag is not."""


@dataclass(frozen=True)
class FoundLag:
    """A description whose lag is set, no longer free, and the lag as a parameter of the result."""

    description: Description
    parameter: Parameter


def with_lag_that_shows(
    rows: Sequence[CampaignRow], description: Description, settings: FitSettings
) -> Description:
    """Return a description with a lag of the current sensors where the reference model shows one.

    With a described shaft that gives, as it is.
    """
    law, prompt = LAWS["sensor-lag"], description.actuator
    if not settings.max_corrections or prompt.transmission is not None or not law.is_possible(prompt):
        return description
    every = replace(settings, every_row=True)
    fitted = fitted_parameters(rows, prompt, description.free)
    found = searched(rows, prompt, fitted, every, description.start)
    if not can_be_compared(found.joint):
        return description
    lagging = law.added_to(prompt)
    variation = every.variation(lagging, fitted)

    def left(lag: float) -> float:
        actuator = with_lumped_parameters(lagging, {NAME: lag})
        return reference_costs(every.objective(rows, actuator, variation), [found.point], settings.seed)[0]

    (before,) = reference_costs(found.joint, [found.point], settings.seed)
    share = min(left(lag) for lag in CURRENT_LAGS_S) / before
    if share >= SHOWN:
        return description
    note = (
        f"The current sensors lag, by the reference model: with a lag {100 * share:.2g} % of the mean "
        "squared residual is left. The averaged model, which compares the laws, hardly shows it."
    )
    return replace(
        description,
        actuator=lagging,
        free=(*description.free, NAME),
        laws=(*description.laws, law),
        law_notes=(*description.law_notes, note),
    )


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
