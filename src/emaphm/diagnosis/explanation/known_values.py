"""Recorded loads and temperatures against what the recording itself says of them.

A recorded value is taken as known. Where it is wrong, faults make up for it: windings that are called cold
read as shorts. The quantity is therefore estimated after all, about the recorded value, by descents from the
estimate; where they lead far away and leave a smaller residual, the recording contradicts the value.
"""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.actuator import Actuator
from emaphm.estimation.global_search.multistart import local_search, with_descents
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.space.nuisances import (
    KNOWN_BY,
    NuisanceSet,
    unit_of,
    usual_deviation,
    with_wider_priors,
)
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.random_streams import stream


@dataclass(frozen=True)
class KnownValueSettings:
    """From when on a recorded value is contradicted; `make study` (spoilt) measures it.

    A temperature is `farthest` standard deviations of its prior off nominal: current alone could not tell it
    from shorts, and the description calls it next to impossible.

    Or the estimate is `deviations` standard deviations of the quantity's prior off the recorded value, and
    leaves less than `share` of the mean squared residual. The prior is `widening` times as wide for it.
    """

    farthest: float = 3.0
    deviations: float = 1.0
    share: float = 0.985
    widening: float = 4.0
    descents: int = 4


KNOWN_VALUES = KnownValueSettings()


def _widened(nuisances: NuisanceSet, actuator: Actuator) -> dict[str, float]:
    """Return how many times as wide as described the priors are: those of selected nuisances are wide."""
    priors = zip(nuisances.chosen, nuisances.prior_deviations[: len(nuisances.chosen)], strict=True)
    return {
        name: float(prior) / usual_deviation(actuator, name)
        for name, prior in priors
        if name not in nuisances.located
    }


def contradicted_values(result: SearchResult, seed: int) -> list[str]:
    """Return a sentence on each recorded load or temperature that the recording contradicts."""
    measured = result.objective.problem.measured
    known = [name for name in ("load", "temperature") if KNOWN_BY[name] in measured]
    return [sentence for name in known if (sentence := _contradicted(result, name, seed))]


def _contradicted(result: SearchResult, name: str, seed: int) -> str:
    objective, settings = result.objective, KNOWN_VALUES
    actuator, channel = objective.problem.actuator, KNOWN_BY[name]
    if name == "temperature" and actuator.electrical is None:
        return ""
    rise, prior = objective.problem.temperature_rise_K, usual_deviation(actuator, name)
    if name == "temperature" and abs(rise) > settings.farthest * prior:
        return (
            f"{channel} is {rise:+.3g} K off nominal, {abs(rise) / prior:.1f} standard deviations of its "
            f"prior ({prior:g} K); check that column, or give a wider one under [nuisances] of the actuator"
        )
    others = tuple(one for one in objective.problem.measured if one != channel)
    nuisances = objective.space.nuisances
    wider = with_wider_priors(actuator, {**_widened(nuisances, actuator), name: settings.widening})
    duration = objective.problem.inputs.duration
    chosen = (*nuisances.chosen, name)
    free = NuisanceSet.of(wider, chosen, others, nuisances.unit, nuisances.located, duration=duration)
    space = ParameterSpace.of(actuator, free)
    start = space.carried_over(result.point, objective.space)
    rows = objective.channel_rows
    freed = replace(objective, space=space)
    correction = freed.of_channels(result.outputs_correction)
    rng = stream(seed, "descents with a known value free", name)
    point = local_search(freed, start, correction, rng, with_descents(settings.descents)).best
    before = float(np.mean(result.residual[:rows] ** 2))
    after = float(np.mean(freed.residual(point, correction)[:rows] ** 2))
    value = float(space.nuisance_values(point[np.newaxis])[name][0])
    if (
        abs(value) <= settings.deviations * usual_deviation(actuator, name)
        or after >= settings.share * before
    ):
        return ""
    return (
        f"{channel}: the recording itself asks for a {name} that is {value:+.3g} "
        f"{unit_of(name, actuator.coordinates)} off the recorded one; check that column, or leave it out"
    )
