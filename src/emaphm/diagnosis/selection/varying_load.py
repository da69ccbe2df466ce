"""A load that varies while the actuator is recorded: over time, and with the position.

In flight the air's load follows speed, attitude and gusts, and rises with the deflection. Taken as constant,
it leaves a recording unexplained, or reads as drifts of sensors. Here it is a spline in time and a stiffness,
or a load that steps, estimated with the faults: what is known of the faults then is what no such load does.
"""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.diagnosis.selection.extension import with_nuisances
from emaphm.diagnosis.selection.laws.law_fit import search_with
from emaphm.diagnosis.selection.load_steps import LOAD_STEP, with_load_steps
from emaphm.diagnosis.selection.residual_share import share_of_residual
from emaphm.diagnosis.selection.settings import SELECTION
from emaphm.errors import DivergedError
from emaphm.estimation.methods import Method
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.problem import Problem
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.space.nuisances import KNOWN_BY, LOAD_VARIATION, described_name, usual_deviation
from emaphm.estimation.uncertainty.local_covariance import jacobians_of
from emaphm.random_streams import child_seed, stream

VARYING_LOAD = (LOAD_VARIATION, "hinge")
"""The nuisances that are such a load, but for its steps."""

LOADS = (*VARYING_LOAD, LOAD_STEP)
"""What may be selected as a load that varies."""


@dataclass(frozen=True)
class VaryingLoadSettings:
    """When a load that varies is searched for, and when it leaves nothing for laws to explain.

    Where the linear model, with it, leaves less than `left` of what the current's residual has beyond noise
    and switching: of 25 recordings of loads that vary it left 3 % at most, of 23 of plants with other laws
    26 to 97 %. And a normalised residual below `convincing`: with such a load, 30 recordings of loads that
    vary had 0.87 to 0.96 (0.02 to 0.1 N·m, or 5 to 20 N·m/rad).
    """

    left: float = 0.15
    convincing: float = 1.0


VARYING = VaryingLoadSettings()

STEP = 0.02
"""Of a coordinate, for a derivative: a tenth of a standard deviation of the prior."""


def with_varying_load(
    searched: SearchResult, method: Method, max_corrections: int, seed: int
) -> tuple[SearchResult, tuple[str, ...]] | None:
    """Return the estimate with a load that varies, from that `searched` without one, and which of `LOADS`.

    None where it does not explain the recording, nor seems to, or where the load is known.
    """
    objective, nuisances = searched.objective, searched.objective.space.nuisances
    problem, measured = objective.problem, tuple(objective.problem.measured)
    estimated = {described_name(name) for name in (*nuisances.chosen, *nuisances.parameters)}
    if estimated & set(VARYING_LOAD) or KNOWN_BY[LOAD_VARIATION] in measured:
        return None
    of_any = replace(objective, problem=replace(problem, actuator=_with_any_load(problem)))
    searched = replace(searched, objective=of_any)
    curved = _with_spline(searched, method, max_corrections, seed)
    if curved is not None and is_convincing(curved):
        return curved, VARYING_LOAD
    stepping = with_load_steps(searched, method, max_corrections, seed)
    if stepping is not None and (
        curved is None or share_of_residual(stepping, curved) < SELECTION.equal_share
    ):
        return stepping, (LOAD_STEP,)
    return None if curved is None else (curved, VARYING_LOAD)


def is_convincing(loaded: SearchResult) -> bool:
    """Return whether a load that varies leaves nothing for laws to explain."""
    return loaded.normalised_residual < VARYING.convincing


def _with_spline(
    searched: SearchResult, method: Method, max_corrections: int, seed: int
) -> SearchResult | None:
    """Return the estimate with a load that is a spline and a stiffness; None where it does not explain."""
    loaded, point = with_nuisances(searched, (), VARYING_LOAD, 1.0)
    if _share_left(searched, loaded, point, seed) > VARYING.left:
        return None
    child = child_seed(seed, "search with a varying load")
    try:
        found = search_with(searched, loaded, LOAD_VARIATION, method, max_corrections, child)
    except DivergedError:  # a load that carries the model away explains nothing
        return None
    return found if found.explained else None


def _share_left(searched: SearchResult, loaded: MapObjective, point: Array, seed: int) -> float:
    """Return the share of the current's residual beyond noise that a linear model with the load leaves.

    `point` (d,) is the estimate in the space of `loaded`.
    """
    samples, before = searched.objective.problem.samples, searched.objective.space
    more = [i for i, name in enumerate(loaded.space.coordinates) if name not in before.coordinates]
    steps = STEP * np.eye(point.size)[more]
    up, down = np.split(loaded.outputs(np.vstack([point + steps, point - steps]))[:, :samples], 2)
    rng = stream(seed, "Jacobians of a varying load")
    jacobian = jacobians_of(searched, rng).mean(axis=0)[:, :samples]
    columns = np.vstack([jacobian, (up - down) / (2 * STEP)]).T
    residual = searched.residual[:samples]
    left = residual - columns @ np.linalg.lstsq(columns, residual)[0]
    noise = searched.residual_variance / searched.normalised_residual**2
    return float((np.mean(left**2) - noise) / (searched.residual_variance - noise))


def explains_better(loaded: SearchResult, rival: SearchResult) -> bool:
    """Return whether a load that varies is believed, and not what explains the recording without one."""
    return not rival.explained or share_of_residual(loaded, rival) < SELECTION.likely_share


def _with_any_load(problem: Problem) -> Actuator:
    """Return the actuator with wide priors for a varying load: any that a motor of its size can move.

    Its stiffness makes a usual load where the command is farthest from its middle; under a command that does
    not change no position shows one, so that any prior does.
    """
    actuator, usual = problem.actuator, usual_deviation(problem.actuator, LOAD_VARIATION)
    reach = float(np.ptp(problem.measured["command_rad"])) / 2 or 1.0
    priors = {LOAD_VARIATION: SELECTION.widening * usual, "hinge": usual / reach}
    return actuator.model_copy(update={"nuisances": actuator.nuisances.model_copy(update=priors)})
