"""A load that varies while the actuator is recorded: over time, and with the position.

In flight the air's load follows speed, attitude and gusts, and rises with the deflection. Taken as constant,
it leaves more residual than is expected, or reads as drifts of sensors. Here it is a spline in time and a
stiffness, or a load that steps, estimated with the faults: what is known of the faults then is what no such
load does.
"""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.actuator import Actuator
from emaphm.diagnosis.selection.extension import with_nuisances
from emaphm.diagnosis.selection.laws.law_fit import Fit
from emaphm.diagnosis.selection.linear_model import LinearModel
from emaphm.diagnosis.selection.load_steps import with_steps
from emaphm.diagnosis.selection.residual_share import leaves_as_much, share_of_residual
from emaphm.diagnosis.selection.selection import Selection
from emaphm.diagnosis.selection.settings import LAW_SELECTION, SELECTION
from emaphm.errors import DivergedError
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.problem import Problem
from emaphm.estimation.reference.refinement import refine_by_reference
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.search_settings import SearchSettings
from emaphm.estimation.space.nuisances import (
    HINGE,
    KNOWN_BY,
    LOAD_VARIATION,
    described_name,
    usual_deviation,
)
from emaphm.simulation.laws.load_steps import STEP_PREFIX

VARYING_LOAD, LOAD_STEP = (LOAD_VARIATION, HINGE), "load_step"
"""The nuisances that are a load that varies without steps; and what one that steps is called."""

LOADS = (*VARYING_LOAD, LOAD_STEP)
"""What may be selected as a load that varies."""


@dataclass(frozen=True)
class VaryingLoadSettings:
    """When a load that varies is searched for, and when it leaves nothing for laws to explain.

    Where the linear model, with it, leaves less than `left` of what the current's residual has beyond noise
    and switching: of 25 recordings of loads that vary it left 3 % at most, of 23 of plants with other laws
    26 to 97 %. With nothing but steps, less than `left_by_steps`: 17 of loads that step left 22 % at most, of
    26 of plants with other laws 53 to 99 %. And where no other load leaves less than 1/`much` of that, or of
    `least`, which is as good as nothing: loads of more parameters left 0.12 to 1 of what was left by the one
    that was there.

    One that steps is searched for where the normalised residual without is above `loud`: steps at instants
    that are chosen among thousands may do as much as a lag of the sensors leaves, 1.2; a step of 0.02 N·m
    left 2.

    And a normalised residual below `convincing`: with such a load, 30 recordings of loads that vary had 0.87
    to 0.96 (0.02 to 0.1 N·m, or 5 to 20 N·m/rad). A load that steps and varies besides has to leave as
    little: 10 that did so left 0.89 to 0.97, but two recordings with a wrong temperature 1.09.
    """

    left: float = 0.15
    left_by_steps: float = 0.3
    much: float = 10.0
    least: float = 0.01
    loud: float = 1.4
    convincing: float = 1.0


VARYING = VaryingLoadSettings()


def with_varying_load(searched: SearchResult, settings: SearchSettings) -> Selection | None:
    """Return the estimate with a load that varies, from that `searched` without one; which of `LOADS` it is.

    The one of least parameters that explains the recording. None where none does, nor seems to, or where the
    load is known.
    """
    objective, nuisances = searched.objective, searched.objective.space.nuisances
    problem, measured = objective.problem, tuple(objective.problem.measured)
    estimated = {described_name(name) for name in (*nuisances.chosen, *nuisances.parameters)}
    if estimated & set(VARYING_LOAD) or KNOWN_BY[LOAD_VARIATION] in measured:
        return None
    of_any = replace(objective, problem=replace(problem, actuator=_with_any_load(problem)))
    searched = replace(searched, objective=of_any)
    tried: list[Selection] = []
    for names, loaded in _promising(searched, settings.seed):
        found = _searched_with(searched, loaded, settings)
        if found is not None and _is_believed(found, names):
            return Selection(found, names)
        if found is not None and not leaves_as_much(found, searched, LAW_SELECTION.clearly_less):
            tried.append(Selection(found, names))
    if not tried:
        return None
    nearest = min(tried, key=lambda one: one.result.normalised_residual)
    refined = refine_by_reference(nearest.result, settings.seed)
    return replace(nearest, result=refined) if _is_believed(refined, nearest.nuisances) else None


def _is_believed(loaded: SearchResult, names: tuple[str, ...]) -> bool:
    """Return whether a load explains the recording: one that is all of `LOADS` at once, convincingly."""
    return is_convincing(loaded) if names == LOADS else loaded.residual_is_expected


def _searched_with(
    searched: SearchResult, loaded: MapObjective, settings: SearchSettings
) -> SearchResult | None:
    """Return the estimate with a load that `loaded` has more, corrected; None if it carries the model away.

    Corrected once more where it explains, but not convincingly: a rise time is the last to converge.
    """
    steps = (name for name in loaded.space.nuisances.names if name.startswith(STEP_PREFIX))
    child = settings.child("search with a varying load", *steps)
    try:
        found = Fit.of(searched, loaded, LOAD_VARIATION, child).corrected(child)
    except DivergedError:
        return None
    if not found.residual_is_expected or is_convincing(found):
        return found
    again = child.child("again")
    anew = correct_bias(loaded, found.point[np.newaxis], again.max_corrections, again.seed)
    return min(found, anew, key=lambda one: one.normalised_residual)


def is_convincing(loaded: SearchResult) -> bool:
    """Return whether a load that varies leaves nothing for laws to explain."""
    return loaded.normalised_residual < VARYING.convincing


def _promising(searched: SearchResult, seed: int) -> list[tuple[tuple[str, ...], MapObjective]]:
    """Return the loads of `LOADS` that may explain the recording, that of least parameters first."""
    alone = LinearModel.of(searched, seed)
    hinged, point = with_nuisances(searched, (), (HINGE,), 1.0)
    hinge_share = alone.with_more(hinged, point).share_left
    spline, point = with_nuisances(searched, (), VARYING_LOAD, 1.0)
    curved = alone.with_more(spline, point)
    is_loud = searched.normalised_residual > VARYING.loud
    stepping = with_steps(searched, (), alone) if is_loud else []
    curved_and_stepping = with_steps(searched, VARYING_LOAD, curved) if is_loud else []
    loads: list[tuple[tuple[str, ...], MapObjective, float]] = [
        ((HINGE,), hinged, hinge_share),
        *(((LOAD_STEP,), *one) for one in stepping),
        (VARYING_LOAD, spline, curved.share_left),
        *((LOADS, *one) for one in curved_and_stepping),
    ]
    most = VARYING.much * max(VARYING.least, min(share for _, _, share in loads))
    left = {names: VARYING.left_by_steps if names == (LOAD_STEP,) else VARYING.left for names, _, _ in loads}
    return [(names, loaded) for names, loaded, share in loads if share <= min(most, left[names])]


def explains_better(loaded: SearchResult, rival: SearchResult) -> bool:
    """Return whether a load that varies is believed, and not what explains the recording without one."""
    return not rival.residual_is_expected or share_of_residual(loaded, rival) < SELECTION.likely_share


def _with_any_load(problem: Problem) -> Actuator:
    """Return the actuator with wide priors for a varying load: any that a motor of its size can move.

    Its stiffness makes a usual load where the command is farthest from its middle; under a command that does
    not change no position shows one, so that any prior does.
    """
    actuator, usual = problem.actuator, usual_deviation(problem.actuator, LOAD_VARIATION)
    reach = float(np.ptp(problem.measured["command_rad"])) / 2 or 1.0
    priors = {LOAD_VARIATION: SELECTION.widening * usual, HINGE: usual / reach}
    return actuator.model_copy(update={"nuisances": actuator.nuisances.model_copy(update=priors)})
