"""Laws that a diagnosis selected, and their parameters in physical units."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from emaphm.actuator import Actuator
from emaphm.actuator.actuator import described_parts
from emaphm.actuator.laws import LAWS, Law
from emaphm.actuator.lumped_parameters import lumped_parameters
from emaphm.actuator.unit.baseline import LUMPED_PARAMETERS, SIGNED
from emaphm.diagnosis.nuisance_estimate import NuisanceEstimate
from emaphm.diagnosis.selection.settings import LAW_SELECTION
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


def shown_laws(
    laws: Sequence[str], nuisances: Mapping[str, NuisanceEstimate], actuator: Actuator
) -> tuple[str, ...]:
    """Return the `laws` that the recording identifies: at least one estimated parameter is known.

    If a law has no effect with all its parameters at 0, one of them must also be significantly different from
    0: the standard errors here contain more than those at the selection (the switching in slow motions; the
    other recordings of a joint diagnosis). A law without estimated parameters is kept: it was compared at its
    starting values.
    """
    return tuple(law for law in laws if _is_shown(LAWS[law], nuisances, actuator))


def _is_shown(law: Law, nuisances: Mapping[str, NuisanceEstimate], actuator: Actuator) -> bool:
    """Return whether the recording identifies a law; arguments as for `shown_laws`."""
    names = [BASELINE + name for name in law.parameters if BASELINE + name in nuisances]
    if not names:
        return True
    estimates = [nuisances[name] for name in names if nuisances[name].known]
    if without_effect_at_zero(law, law.added_to(actuator)):
        significant = LAW_SELECTION.significant
        estimates = [one for one in estimates if abs(one.value) > significant * one.standard_error]
    return bool(estimates)


def without_effect_at_zero(law: Law, actuator: Actuator) -> bool:
    """Return whether `law`, which the `actuator` has, acts only through parameters that begin at 0."""
    described = tuple(name for name in law.parameters if described_parts(actuator, name) is not None)
    return not any(lumped_parameters(actuator, described).values())


def without_laws(
    nuisances: Mapping[str, NuisanceEstimate], laws: Sequence[str]
) -> dict[str, NuisanceEstimate]:
    """Return the `nuisances` without the parameters of the `laws`."""
    of_laws = {BASELINE + name for law in laws for name in LAWS[law].parameters}
    return {name: estimate for name, estimate in nuisances.items() if name not in of_laws}
