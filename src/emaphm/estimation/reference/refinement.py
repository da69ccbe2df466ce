"""Gauss-Newton steps by the reference model itself, where the corrected averaged model leads no farther.

The correction of the bias takes the discrepancy between the two models as constant near the estimate. Where
it is not, as with a shaft that gives and hits the edges of its backlash, the iterations stop short of the
optimum and the residual stays above noise and switching. The derivatives of the reference model, over
differences that are large against its switching, lead on from there.
"""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.estimation.bias_correction import compared, gauss_newton
from emaphm.estimation.discrepancy import reference_problem
from emaphm.estimation.finite_differences import replicated_jacobians
from emaphm.estimation.problem import Problem
from emaphm.estimation.search_result import SearchResult
from emaphm.random_streams import stream


@dataclass(frozen=True)
class RefinementSettings:
    """How the reference model is asked for steps; `make study` (limits, compliant shafts) shows the effect.

    `replicates` Jacobians over central differences of `jacobian_step`, which is reduced by `reduction` after
    an iteration without progress; then `step_shares` of the step are compared. A residual above `farthest`
    times noise and switching is a false minimum, which a new search leaves sooner.
    """

    iterations: int = 8
    replicates: int = 12
    jacobian_step: float = 2e-2
    reduction: float = 0.5
    step_shares: tuple[float, ...] = (0.1, 0.3, 0.6, 1.0)
    progress: float = 0.9
    patience: int = 2
    farthest: float = 8.0


REFINEMENT = RefinementSettings()


def refine_by_reference(
    result: SearchResult, seed: int, settings: RefinementSettings = REFINEMENT
) -> SearchResult:
    """Return `result` moved on to where the reference model fits best.

    If its residual exceeds noise and switching, or the shaft gives: its oscillation looks like noise.
    """
    oscillates = result.objective.problem.actuator.transmission is not None
    if result.residual_over_noise > settings.farthest or (result.down_to_noise and not oscillates):
        return result
    reference = reference_problem(result.objective)
    idle, difference, ended = 0, settings.jacobian_step, False
    for iteration in range(settings.iterations):
        result = result.reweighted()
        best = _step(result, reference, difference, seed, iteration, settings)
        progress = best.misfit < settings.progress * result.misfit
        if best.misfit < result.misfit:
            result = best
        idle = 0 if progress else idle + 1
        difference *= 1.0 if progress else settings.reduction
        ended = idle == settings.patience or (result.down_to_noise and not oscillates)
        if ended:
            break
    return replace(result, converged=ended)


def _step(
    result: SearchResult,
    reference: Problem,
    difference: float,
    seed: int,
    iteration: int,
    settings: RefinementSettings,
) -> SearchResult:
    """Return the best of the points along a Gauss-Newton step from `result` by the reference model."""
    objective, space = result.objective, result.objective.space
    weighted = replace(objective, problem=reference.like(objective.problem))
    jacobians = replicated_jacobians(
        weighted.outputs,
        result.point,
        space,
        difference,
        settings.replicates,
        stream(seed, "Jacobians of the reference model", iteration),
    )
    step = gauss_newton(objective, result.point, result.residual, jacobians)
    points = space.project(result.point + np.array(settings.step_shares)[:, np.newaxis] * step)
    rng = stream(seed, "reference runs of the refinement", iteration)
    outcomes = compared(objective, np.zeros_like(objective.target), points, reference, rng)
    best = min(outcomes, key=lambda one: one.misfit)
    # The discrepancy at the new point is the correction under which the point is the optimum.
    return replace(best, correction=best.outputs_correction, scatter=result.scatter)
