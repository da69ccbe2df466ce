"""Correction of the fitted model's bias by a few runs of the reference model (docs/physics.md, section 9).

The averaged model differs from the reference model, so its best fit is biased. The discrepancy of the two
models at the estimate is added to the averaged model's outputs, and the fit is repeated from the estimate:
space mapping, an additive multi-fidelity correction (Bandler et al. 2004; March and Willcox 2012).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.correction_iterations import BIAS_CORRECTION, iterate, never
from emaphm.estimation.discrepancy import discrepancies, has_reference, reference_problem, with_all_phases
from emaphm.estimation.finite_differences import replicated_jacobians
from emaphm.estimation.global_search.multistart import LOCAL_SEARCH, local_search
from emaphm.estimation.levenberg_marquardt import bounded_step
from emaphm.estimation.objective import CORRELATED_ROWS, MapObjective
from emaphm.estimation.problem import Problem
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.space.parameter_space import PRIOR_DEVIATION
from emaphm.estimation.standstill import with_rests
from emaphm.estimation.uncertainty.fisher_information import normal_equations
from emaphm.progress import Progress
from emaphm.random_streams import stream

MAX_CORRECTIONS = 10
"""Most correction iterations; most recordings take 4 to 6."""


@dataclass(frozen=True, eq=False)
class _Jacobians:
    """Replicated Jacobians (n, d, rows), with the weights of `objective` on the rows."""

    objective: MapObjective
    values: Array


def correct_bias(
    objective: MapObjective,
    points: Array,
    max_corrections: int,
    seed: int,
    on_progress: Progress | None = None,
    *,
    is_hopeless: Callable[[SearchResult], bool] = never,
) -> SearchResult:
    """Return the estimate after up to `max_corrections` iterations, from the best of `points` (n, d).

    Each iteration proposes candidates under the current correction and evaluates the misfit of each with the
    reference model. The result is the mean of the estimates of the last iterations without progress, because
    the reference model finds no difference between them. If the estimate `is_hopeless`, the first iteration
    without progress is the last.
    """
    reference = reference_problem(objective)
    jacobians: _Jacobians | None = None

    def outcomes_of(current: SearchResult, iteration: int, idle: int) -> list[SearchResult]:
        nonlocal jacobians
        correction = current.outputs_correction
        candidates, jacobians = _candidates(current, correction, jacobians if idle else None, iteration, seed)
        rng = stream(seed, "reference runs", iteration)
        return compared(current.objective, candidates, reference, rng, correction)

    starts = compared(objective, points, reference, stream(seed, "reference runs", "starts"))
    best = min(starts, key=lambda start: start.residual_variance)
    resting = with_rests(objective, best.point, reference, stream(seed, "reference runs", "rests"))
    if resting is not objective:
        reference = with_all_phases(reference)
        rng = stream(seed, "reference runs", "start")
        (best,) = compared(resting, best.point[np.newaxis], reference, rng)
    end = iterate(best, outcomes_of, max_corrections, on_progress, is_hopeless)
    if on_progress:
        on_progress(1.0)
    return _mean(replace(end.estimate, converged=end.converged), end.equal)


def with_discrepancy(result: SearchResult, seed: int) -> SearchResult:
    """Return an estimate without correction together with its discrepancy, if a reference model can run."""
    if result.discrepancy is not None or not has_reference(result.objective.problem):
        return result
    (discrepancy,) = discrepancies(
        result.objective,
        result.point[np.newaxis],
        result.outputs[np.newaxis],
        reference_problem(result.objective),
        stream(seed, "reference runs"),
    )
    return replace(result, discrepancy=discrepancy)


def over_all_phases(result: SearchResult, seed: int) -> SearchResult:
    """Return a corrected estimate with its discrepancy from runs whose ripple has all phases.

    Without hysteresis or without a correction, the result is returned unchanged.
    """
    objective = result.objective
    if objective.problem.actuator.drive_kind != "hysteresis" or not result.correction.any():
        return result
    (discrepancy,) = discrepancies(
        objective,
        result.point[np.newaxis],
        result.outputs[np.newaxis],
        with_all_phases(reference_problem(objective)),
        stream(seed, "reference runs of all phases"),
    )
    return replace(result, correction=discrepancy.mean, discrepancy=discrepancy)


def compared(
    objective: MapObjective,
    points: Array,
    reference: Problem,
    rng: np.random.Generator,
    correction: Array | None = None,
) -> list[SearchResult]:
    """Return results at `points` (n, d) with their discrepancies.

    `correction` (rows,) is the one under which the points were searched; by default, none.
    """
    outputs = objective.outputs(points)
    at_points = discrepancies(objective, points, outputs, reference, rng)
    return [
        SearchResult.at(objective, point, outputs=modelled, correction=correction, discrepancy=discrepancy)
        for point, modelled, discrepancy in zip(points, outputs, at_points, strict=True)
    ]


def _candidates(
    current: SearchResult,
    correction: Array,
    before: _Jacobians | None,
    iteration: int,
    seed: int,
) -> tuple[Array, _Jacobians]:
    """Return candidates (n, d) under the current `correction`, and the Jacobians of the proposed steps.

    `before` are the Jacobians of an iteration that ended at the same point. A Gauss-Newton step by replicated
    Jacobians leaves a local minimum at a kink of stick-slip, at which a descent stops, but may also increase
    the misfit; the candidates are therefore shares of the step.
    """
    objective, space = current.objective, current.objective.space
    descents = LOCAL_SEARCH.descents if before is None else BIAS_CORRECTION.further_descents
    rng = stream(seed, "local search", iteration)
    point = local_search(objective, current.point, correction, rng, descents).best
    jacobians = replicated_jacobians(
        objective.outputs,
        point,
        space,
        BIAS_CORRECTION.jacobian_step,
        BIAS_CORRECTION.replicates if before is None else BIAS_CORRECTION.further_replicates,
        stream(seed, "Jacobians of the correction", iteration),
    )
    if before is not None:
        jacobians = np.concatenate([objective.rescaled(before.values, before.objective), jacobians])
    step = gauss_newton(objective, point, objective.residual(point, correction), jacobians)
    return space.project(point + BIAS_CORRECTION.steps_along(step)), _Jacobians(objective, jacobians)


def gauss_newton(objective: MapObjective, point: Array, residual: Array, jacobians: Array) -> Array:
    """Return the step (d,) to the optimum of a linear model with the mean of the Jacobians.

    A fault has no prior; directions that the channels do not constrain keep the fault's value.
    """
    space, rows = objective.space, objective.channel_rows
    normal, gradient = normal_equations(jacobians[:, :, :rows], residual[:rows], space.prior_deviations)
    # Priors are exact: they alone determine the directions that the channels do not constrain.
    priors = objective.jacobian_of_priors
    normal = normal + priors @ priors.T
    gradient = gradient + priors @ residual[rows:]
    faults = np.arange(len(space.columns))
    normal[faults, faults] += float(np.mean(residual**2)) * CORRELATED_ROWS / PRIOR_DEVIATION**2
    return bounded_step(normal, gradient, point, space)


def _mean(current: SearchResult, equal: Sequence[SearchResult]) -> SearchResult:
    """Return the mean of the estimates of `equal` misfit, if its own misfit is also equal.

    The covariance of these estimates is the scatter of the optimiser's end point.
    """
    if len(equal) < 2:
        return current
    equal = [estimate.weighted_as(current.objective) for estimate in equal]
    points = np.array([estimate.point for estimate in equal])
    point, scatter = points.mean(axis=0), np.cov(points, rowvar=False)
    known = [estimate.discrepancy for estimate in equal if estimate.discrepancy is not None]
    assert current.discrepancy is not None  # noqa: S101 - every result of a correction has a discrepancy
    mean = replace(
        current,
        point=point,
        known_outputs=None,
        correction=np.mean([estimate.correction for estimate in equal], axis=0),
        discrepancy=replace(current.discrepancy, mean=np.mean([term.mean for term in known], axis=0)),
        scatter=scatter / len(equal),
    )
    if mean.misfit <= BIAS_CORRECTION.equal_misfits * current.misfit:
        return mean
    return replace(current, scatter=scatter)
