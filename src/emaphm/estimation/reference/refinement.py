"""Gauss-Newton steps with the reference model itself, after the corrections of the averaged model.

The bias correction assumes that the discrepancy between the two models is constant near the estimate. Where
it is not constant, for example with a compliant shaft that hits the edges of its backlash, the iterations
stop short of the optimum and the residual stays above noise and switching. Steps with the derivatives of the
reference model, over differences that are large compared with its switching, then continue.
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
    """Settings of the steps; `make study` (limits, compliant shafts) measures their effect.

    An iteration computes `replicates` Jacobians over central differences of `jacobian_step`, which is
    multiplied by `reduction` after an iteration without progress; it then compares the `step_shares` of the
    step. With a residual above `farthest` times noise and switching, the estimate is at a wrong local
    minimum, from which a new search is faster.
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
    """Return the optimum of the reference model near `result`.

    Steps are taken if the residual exceeds noise and switching, or if the shaft is compliant, because its
    oscillation counts as noise. Otherwise, `result` is returned.
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
    """Return the best point along a Gauss-Newton step of the reference model from `result`."""
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
    outcomes = compared(objective, points, reference, rng)
    best = min(outcomes, key=lambda outcome: outcome.misfit)
    # With the discrepancy at the new point as the correction, the point is the optimum.
    return replace(best, correction=best.outputs_correction, scatter=result.scatter)
