"""Estimation of a load that varies during the recording: over time, and with the position.

In flight the aerodynamic load changes with speed, attitude and gusts, and rises with the deflection. If it is
assumed constant, the residual exceeds the expected size, or drifts of sensors appear. Here it is a spline in
time and a stiffness, or a load with steps, estimated with the faults. Effects that such a load can cause are
then no evidence of a fault.
"""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.actuator import Actuator
from emaphm.diagnosis.selection.extension import with_nuisances
from emaphm.diagnosis.selection.laws.law_fit import Fit
from emaphm.diagnosis.selection.linear_model import LinearModel
from emaphm.diagnosis.selection.load_steps import with_steps
from emaphm.diagnosis.selection.residual_share import is_residual_above, share_of_residual
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
"""The nuisances of a varying load without steps, and the name of a load with steps."""

LOADS = (*VARYING_LOAD, LOAD_STEP)
"""Names under which a varying load is selected."""


@dataclass(frozen=True)
class VaryingLoadSettings:
    """Limits for searching for a varying load, and for accepting it without testing laws.

    A load is searched for if the linear model with it leaves less than `left` of the current's squared
    residual beyond noise and switching: this was at most 3 % in 25 recordings with varying loads, and 26 to
    97 % in 23 of plants with other laws. With steps only, the limit is `left_by_steps`: at most 22 % in 17
    recordings with steps, 53 to 99 % in 26 of plants with other laws. The share must also be at most `much`
    times the smallest share of all loads, or times `least`, below which shares do not matter: loads with more
    parameters had 0.12 to 1 of the share of the true load.

    Steps are searched for if the normalised residual without them is above `loud`: steps at instants chosen
    among thousands may have as much effect as a lag of the sensors, which leaves 1.2; a step of 0.02 N·m
    left 2.

    No laws are tested if the normalised residual with the load is below `convincing`: 30 recordings with
    varying loads had 0.87 to 0.96 (0.02 to 0.1 N·m, or 5 to 20 N·m/rad). A load with steps and a spline is
    accepted only below this limit: 10 such loads had 0.89 to 0.97, two recordings with a wrong temperature
    1.09.
    """

    left: float = 0.15
    left_by_steps: float = 0.3
    much: float = 10.0
    least: float = 0.01
    loud: float = 1.4
    convincing: float = 1.0


VARYING = VaryingLoadSettings()


def with_varying_load(searched: SearchResult, settings: SearchSettings) -> Selection | None:
    """Return the estimate with a varying load, and its names in `LOADS`; `searched` is the estimate without.

    The load has the fewest parameters with which the recording is explained. None if no load explains it, or
    if the load is known.
    """
    objective, nuisances = searched.objective, searched.objective.space.nuisances
    problem, measured = objective.problem, tuple(objective.problem.measured)
    estimated = {described_name(name) for name in (*nuisances.chosen, *nuisances.parameters)}
    if estimated & set(VARYING_LOAD) or KNOWN_BY[LOAD_VARIATION] in measured:
        return None
    with_wide_priors = replace(objective, problem=replace(problem, actuator=_with_any_load(problem)))
    searched = replace(searched, objective=with_wide_priors)
    improved: list[Selection] = []
    for names, loaded in _promising_loads(searched, settings.seed):
        estimate = _estimate_with(searched, loaded, settings)
        if estimate is not None and _is_accepted(estimate, names):
            return Selection(estimate, names)
        if estimate is not None and not is_residual_above(estimate, searched, LAW_SELECTION.clearly_less):
            improved.append(Selection(estimate, names))
    if not improved:
        return None
    nearest = min(improved, key=lambda selection: selection.result.normalised_residual)
    refined = refine_by_reference(nearest.result, settings.seed)
    return replace(nearest, result=refined) if _is_accepted(refined, nearest.nuisances) else None


def _is_accepted(loaded: SearchResult, names: tuple[str, ...]) -> bool:
    """Return whether a load explains the recording; all of `LOADS` together must do so convincingly."""
    return is_convincing(loaded) if names == LOADS else loaded.residual_is_expected


def _estimate_with(
    searched: SearchResult, loaded: MapObjective, settings: SearchSettings
) -> SearchResult | None:
    """Return the corrected estimate with the additional load of `loaded`; None if the model diverges.

    It is corrected once more if it explains the recording, but not convincingly: a rise time converges last.
    """
    steps = (name for name in loaded.space.nuisances.names if name.startswith(STEP_PREFIX))
    child = settings.child("search with a varying load", *steps)
    try:
        estimate = Fit.of(searched, loaded, LOAD_VARIATION, child).corrected(child)
    except DivergedError:
        return None
    if not estimate.residual_is_expected or is_convincing(estimate):
        return estimate
    again = child.child("again")
    repeated = correct_bias(loaded, estimate.point[np.newaxis], again.max_corrections, again.seed)
    return min(estimate, repeated, key=lambda candidate: candidate.normalised_residual)


def is_convincing(loaded: SearchResult) -> bool:
    """Return whether the residual with a varying load is so small that no laws are tested."""
    return loaded.normalised_residual < VARYING.convincing


def _promising_loads(searched: SearchResult, seed: int) -> list[tuple[tuple[str, ...], MapObjective]]:
    """Return the loads of `LOADS` that may explain the recording, those with fewest parameters first."""
    without_load = LinearModel.of(searched, seed)
    hinged, point = with_nuisances(searched, (), (HINGE,), 1.0)
    hinge_share = without_load.with_more(hinged, point).share_left
    spline, point = with_nuisances(searched, (), VARYING_LOAD, 1.0)
    with_spline = without_load.with_more(spline, point)
    is_loud = searched.normalised_residual > VARYING.loud
    with_load_steps = with_steps(searched, (), without_load) if is_loud else []
    with_all = with_steps(searched, VARYING_LOAD, with_spline) if is_loud else []
    loads: list[tuple[tuple[str, ...], MapObjective, float]] = [
        ((HINGE,), hinged, hinge_share),
        *(((LOAD_STEP,), *steps) for steps in with_load_steps),
        (VARYING_LOAD, spline, with_spline.share_left),
        *((LOADS, *steps) for steps in with_all),
    ]
    largest_share = VARYING.much * max(VARYING.least, min(share for _, _, share in loads))
    limits = {
        names: VARYING.left_by_steps if names == (LOAD_STEP,) else VARYING.left for names, _, _ in loads
    }
    return [(names, loaded) for names, loaded, share in loads if share <= min(largest_share, limits[names])]


def explains_better(loaded: SearchResult, rival: SearchResult) -> bool:
    """Return whether the varying load is preferred to the estimate `rival` without it."""
    return not rival.residual_is_expected or share_of_residual(loaded, rival) < SELECTION.likely_share


def _with_any_load(problem: Problem) -> Actuator:
    """Return the actuator with wide priors for a varying load: all loads that a motor of its size can move.

    The prior of the load stiffness gives a load of usual size where the command is farthest from its middle.
    With a constant command the stiffness has no effect, and any prior is adequate.
    """
    actuator, usual = problem.actuator, usual_deviation(problem.actuator, LOAD_VARIATION)
    reach = float(np.ptp(problem.measured["command_rad"])) / 2 or 1.0
    priors = {LOAD_VARIATION: SELECTION.widening * usual, HINGE: usual / reach}
    return actuator.model_copy(update={"nuisances": actuator.nuisances.model_copy(update=priors)})
