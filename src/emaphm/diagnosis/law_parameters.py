"""The laws that a diagnosis found, and their parameters in their own units."""

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
    """Return the values of the parameters of `laws` that were estimated, by the parameter's name.

    Among the `nuisances` they are deviations from the values that the law was started with, which no
    description has: a value v there is start · exp(v) here, but for parameters of either sign, which are
    estimated themselves.
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
    """Return those of `laws` that a recording shows: one of the estimated parameters at least is known.

    A law none of whose parameters was estimated is kept: it was compared at the values it was started with.
    """
    estimated = {
        law: [nuisances[BASELINE + name] for name in LAWS[law].parameters if BASELINE + name in nuisances]
        for law in laws
    }
    return tuple(law for law, values in estimated.items() if not values or any(one.known for one in values))


def without_laws(
    nuisances: Mapping[str, NuisanceEstimate], laws: Sequence[str]
) -> dict[str, NuisanceEstimate]:
    """Return the `nuisances` less the parameters that the `laws` bring."""
    brought = {BASELINE + name for law in laws for name in LAWS[law].parameters}
    return {name: one for name, one in nuisances.items() if name not in brought}
