"""Objectives with additional nuisances, and candidates for the selection."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from emaphm.arrays import Array
from emaphm.diagnosis.selection.settings import widening
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.space.nuisances import Located, NuisanceSet, with_wider_priors
from emaphm.estimation.space.parameter_space import ParameterSpace

ZEROS_OF_START = {"position_offset": "position_rad", "speed_offset": "speed_rad_s"}
"""Sensors that determine the start of a manoeuvre, by the nuisance of their zero."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A nuisance, the objective with it, the end point (d,) of descents, and the share of residual there.

    The share is that of the averaged model, or of the reference model if the nuisance is profiled. A
    candidate that is not `promising` is tried only if a sensor error would be selected otherwise.
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

    They have wide priors, like the nuisances `names`, which were selected before; with `factor`, the priors
    are `factor` times as wide. A `located` nuisance is fixed at its value, like one that was located before;
    None frees it again.
    """
    objective = result.objective
    actuator, measured = objective.problem.actuator, tuple(objective.problem.measured)
    before = objective.space.nuisances
    chosen = (*before.chosen, *more)
    factors = {name: widening(name) for name in (*names, *more)}
    wider = with_wider_priors(actuator, factors | (dict.fromkeys(more, factor) if factor else {}))
    new = located or {}
    locations = {
        name: location for name, location in {**before.located, **new}.items() if location is not None
    }
    duration = objective.problem.inputs.duration
    nuisances = NuisanceSet.of(wider, chosen, measured, before.unit, locations, duration=duration)
    space = ParameterSpace.of(actuator, nuisances)
    point = space.carried_over(result.point, objective.space)
    point[[name in new for name in space.coordinates]] = 0.0
    problem = objective.problem
    for name, channel in ZEROS_OF_START.items():
        # A sensor with an unknown zero does not determine the start of the manoeuvre.
        if more == (name,) or name in names:
            problem = problem.starting_without(channel)
    return replace(objective, problem=problem, space=space), point
