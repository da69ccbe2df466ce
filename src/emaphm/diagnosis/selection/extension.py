"""An objective with more nuisances, and what may come of it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from emaphm.arrays import Array
from emaphm.diagnosis.selection.settings import widening
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.space.nuisances import Located, NuisanceSet, with_wider_priors
from emaphm.estimation.space.parameter_space import ParameterSpace

ZEROS_OF_START = {"position_offset": "position_rad", "speed_offset": "speed_rad_s"}
"""Zeros of the sensors that say where a manoeuvre starts, by nuisance."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A nuisance, the objective and point (d,) that descents with it lead to, and the share of residual.

    The share is that of the descents, or the reference model's where the nuisance is profiled. One that is
    not `promising` is tried only where its rivals would be selected.
    """

    name: str
    objective: MapObjective
    point: Array
    share: float
    promising: bool = True


def with_nuisances(
    result: SearchResult,
    names: tuple[str, ...],
    more: tuple[str, ...],
    factor: float | None = None,
    located: Mapping[str, Located | None] | None = None,
) -> tuple[MapObjective, Array]:
    """Return the objective with `more` nuisances, and the point (d,) of `result` in its space.

    They have wide priors, as have `names`, which were selected before; `factor` times as wide where given.
    What is `located` is at its value instead, and stays there, as does what was located before; it is free
    again where that is None.
    """
    objective = result.objective
    actuator, measured = objective.problem.actuator, tuple(objective.problem.measured)
    before = objective.space.nuisances
    chosen = (*before.chosen, *more)
    factors = {name: widening(name) for name in (*names, *more)}
    wider = with_wider_priors(actuator, factors | (dict.fromkeys(more, factor) if factor else {}))
    new = located or {}
    known = {name: one for name, one in {**before.located, **new}.items() if one is not None}
    duration = objective.problem.inputs.duration
    nuisances = NuisanceSet.of(wider, chosen, measured, before.unit, known, duration=duration)
    space = ParameterSpace.of(actuator, nuisances)
    point = space.carried_over(result.point, objective.space)
    point[[name in new for name in space.coordinates]] = 0.0
    problem = objective.problem
    for name, channel in ZEROS_OF_START.items():
        # What is recorded does not say where the manoeuvre starts if its zero is not known.
        if more == (name,) or name in names:
            problem = problem.starting_without(channel)
    return replace(objective, problem=problem, space=space), point
