"""A load that varies while the actuator is recorded: over time, and with the position.

In flight the air's load follows speed, attitude and gusts, and rises with the deflection. Taken as constant,
it leaves a recording unexplained, or reads as drifts of sensors. Here it is a spline in time and a stiffness,
estimated with the faults: what is known of the faults then is what no such load does.
"""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.actuator import Actuator
from emaphm.diagnosis.selection.law_selection import fit_of
from emaphm.diagnosis.selection.nuisance_selection import share_of_residual
from emaphm.diagnosis.selection.settings import SELECTION
from emaphm.errors import DivergedError
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.methods import Method
from emaphm.estimation.problem import Problem
from emaphm.estimation.reference.refinement import refine_by_reference
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.space.nuisances import (
    KNOWN_BY,
    LOAD_VARIATION,
    NuisanceSet,
    described_name,
    usual_deviation,
)
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.random_streams import child_seed

VARYING_LOAD = (LOAD_VARIATION, "hinge")
"""The nuisances that are such a load."""


@dataclass(frozen=True)
class VaryingLoadSettings:
    """When a load that varies leaves nothing for laws to explain: a normalised residual below `convincing`.

    With such a load, 30 recordings of loads that vary had 0.87 to 0.96 (0.02 to 0.1 N·m, or 5 to 20 N·m/rad).
    Of 36 recordings of plants with other laws one was explained by such a load, with 1.07.
    """

    convincing: float = 1.0


VARYING = VaryingLoadSettings()


def with_varying_load(
    searched: SearchResult, method: Method, max_corrections: int, seed: int
) -> SearchResult | None:
    """Return the estimate with a load that varies, from that `searched` without one.

    None where it does not explain the recording, the load is recorded, or is estimated so already.
    """
    objective, nuisances = searched.objective, searched.objective.space.nuisances
    problem, measured = objective.problem, tuple(objective.problem.measured)
    estimated = {described_name(name) for name in (*nuisances.chosen, *nuisances.parameters)}
    if estimated & set(VARYING_LOAD) or KNOWN_BY[LOAD_VARIATION] in measured:
        return None
    actuator = _with_any_load(problem)
    chosen = (*nuisances.chosen, *VARYING_LOAD)
    duration = problem.inputs.duration
    free = NuisanceSet.of(actuator, chosen, measured, nuisances.unit, nuisances.located, duration=duration)
    loaded = replace(
        objective,
        problem=replace(problem, actuator=actuator),
        space=ParameterSpace.of(actuator, free),
    )
    child = child_seed(seed, "search with a varying load")
    try:
        fit = fit_of(searched, loaded, LOAD_VARIATION, method, child)
        found = refine_by_reference(correct_bias(fit.objective, fit.points, max_corrections, child), child)
    except DivergedError:  # a load that carries the model away explains nothing
        return None
    return found if found.explained else None


def explains_better(loaded: SearchResult, rival: SearchResult) -> bool:
    """Return whether a load that varies is believed, and not what explains the recording without one."""
    return not rival.explained or share_of_residual(loaded, rival) < SELECTION.likely_share


def _with_any_load(problem: Problem) -> Actuator:
    """Return the actuator with wide priors for a varying load: any that a motor of its size can move.

    Its stiffness makes a usual load where the command is farthest from its middle.
    """
    actuator, usual = problem.actuator, usual_deviation(problem.actuator, LOAD_VARIATION)
    reach = float(np.ptp(problem.measured["command_rad"])) / 2
    priors = {LOAD_VARIATION: SELECTION.widening * usual, "hinge": usual / reach}
    return actuator.model_copy(update={"nuisances": actuator.nuisances.model_copy(update=priors)})
