"""Laws that a diagnosis selected, and their parameters in physical units."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from emaphm.actuator import Actuator
from emaphm.actuator.laws import LAWS
from emaphm.actuator.lumped_parameters import lumped_parameters
from emaphm.actuator.unit.baseline import LUMPED_PARAMETERS, SIGNED
from emaphm.diagnosis.nuisance_estimate import NuisanceEstimate
from emaphm.estimation.space.nuisances import BASELINE


def law_parameters(
    nuisances: Mapping[str, NuisanceEstimate], laws: Sequence[str], actuator: Actuator
) -> dict[str, NuisanceEstimate]:
    """Return the estimated values of the parameters of `laws`, by parameter name.

    The `nuisances` contain deviations v of the logarithm from the law's starting value, which no description
    has; the value is start · exp(v). A parameter of either sign is estimated in its own unit.
    """
    values = {}
    for law in (LAWS[name] for name in laws):
        actuator = law.added_to(actuator)
        for name in law.parameters:
            estimate = nuisances.get(BASELINE + name)
            if estimate is None:
                continue
            if name not in SIGNED:
                (start,) = lumped_parameters(actuator, (name,)).values()
                value = start * math.exp(estimate.value)
                estimate = replace(estimate, value=value, standard_error=abs(value) * estimate.standard_error)
            values[name] = replace(estimate, unit=LUMPED_PARAMETERS[name])
    return values


def shown_laws(laws: Sequence[str], nuisances: Mapping[str, NuisanceEstimate]) -> tuple[str, ...]:
    """Return the `laws` that the recording identifies: at least one estimated parameter is known.

    A law without estimated parameters is kept: it was compared at its starting values.
    """
    estimated = {
        law: [nuisances[BASELINE + name] for name in LAWS[law].parameters if BASELINE + name in nuisances]
        for law in laws
    }
    return tuple(
        law
        for law, estimates in estimated.items()
        if not estimates or any(estimate.known for estimate in estimates)
    )


def without_laws(
    nuisances: Mapping[str, NuisanceEstimate], laws: Sequence[str]
) -> dict[str, NuisanceEstimate]:
    """Return the `nuisances` without the parameters of the `laws`."""
    of_laws = {BASELINE + name for law in laws for name in LAWS[law].parameters}
    return {name: estimate for name, estimate in nuisances.items() if name not in of_laws}
