"""Test of recorded loads and temperatures against their estimates.

A recorded value is taken as known. If it is wrong, faults compensate for it: with a recorded temperature that
is too low, shorts appear. The quantity is therefore estimated by descents from the estimate, about its
recorded value. If they end far from this value, with a smaller residual, the recording contradicts it.
"""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.actuator import Actuator
from emaphm.estimation.global_search.multistart import local_search
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
    """Limits from which a recorded value is contradicted; `make study` (spoilt) measures the effect.

    A temperature is more than `farthest` standard deviations of its prior from nominal: from the current
    alone it could not be distinguished from shorts, and by the description it is almost impossible.

    Or the estimate is more than `deviations` standard deviations of its prior from the recorded value, with
    less than `share` of the mean squared residual. For this estimate the prior is `widening` times as wide.
    """

    farthest: float = 3.0
    deviations: float = 1.0
    share: float = 0.985
    widening: float = 4.0
    descents: int = 4


KNOWN_VALUES = KnownValueSettings()


def _widening_factors(nuisances: NuisanceSet, actuator: Actuator) -> dict[str, float]:
    """Return the factors by which the priors are wider than described: those of selected nuisances are."""
    priors = zip(nuisances.chosen, nuisances.prior_deviations[: len(nuisances.chosen)], strict=True)
    return {
        name: float(prior) / usual_deviation(actuator, name)
        for name, prior in priors
        if name not in nuisances.located
    }


def contradicted_values(result: SearchResult, seed: int) -> list[str]:
    """Return a sentence on each recorded load or temperature that the recording contradicts."""
    measured = result.objective.problem.measured
    recorded = [name for name in ("load", "temperature") if KNOWN_BY[name] in measured]
    return [sentence for name in recorded if (sentence := _contradiction_of(result, name, seed))]


def _contradiction_of(result: SearchResult, name: str, seed: int) -> str:
    """Return a sentence if the recording contradicts the recorded value of `name`; else an empty one."""
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
    other_columns = tuple(column for column in objective.problem.measured if column != channel)
    nuisances = objective.space.nuisances
    wider = with_wider_priors(actuator, {**_widening_factors(nuisances, actuator), name: settings.widening})
    duration = objective.problem.inputs.duration
    chosen = (*nuisances.chosen, name)
    free = NuisanceSet.of(wider, chosen, other_columns, nuisances.unit, nuisances.located, duration=duration)
    space = ParameterSpace.of(actuator, free)
    start = space.carried_over(result.point, objective.space)
    rows = objective.channel_rows
    freed = replace(objective, space=space)
    correction = freed.of_channels(result.outputs_correction)
    rng = stream(seed, "descents with a known value free", name)
    point = local_search(freed, start, correction, rng, settings.descents).best
    before = float(np.mean(result.residual[:rows] ** 2))
    after = float(np.mean(freed.residual(point, correction)[:rows] ** 2))
    value = float(space.nuisance_values(point[np.newaxis])[name][0])
    if (
        abs(value) <= settings.deviations * usual_deviation(actuator, name)
        or after >= settings.share * before
    ):
        return ""
    return (
        f"{channel}: the {name} estimated from the other channels differs by {value:+.3g} "
        f"{unit_of(name, actuator.coordinates)} from the recorded one; check that column, or leave it out"
    )
