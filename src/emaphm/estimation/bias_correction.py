"""Correction of the fitted model's bias by a few runs of the reference model (docs/physics.md, section 9).

The averaged model is not the reference model, so its best fit is biased. Their discrepancy at the estimate is
added to the averaged model's outputs, and the fit repeated from there: space mapping, or a multi-fidelity
additive correction (Bandler et al. 2004; March and Willcox 2012).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.correction_iterations import BIAS_CORRECTION, BiasCorrectionSettings, iterate, never
from emaphm.estimation.discrepancy import discrepancies, has_reference, reference_problem, with_all_phases
from emaphm.estimation.finite_differences import replicated_jacobians
from emaphm.estimation.global_search.multistart import LOCAL_SEARCH, local_search, with_descents
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
    """Replicated Jacobians (n, d, rows), as `objective` weights the rows."""

    objective: MapObjective
    values: Array


def correct_bias(
    objective: MapObjective,
    points: Array,
    max_corrections: int,
    seed: int,
    on_progress: Progress | None = None,
    settings: BiasCorrectionSettings = BIAS_CORRECTION,
    *,
    is_hopeless: Callable[[SearchResult], bool] = never,
) -> SearchResult:
    """Return the estimate after up to `max_corrections` iterations, from the best of `points` (n, d).

    Each iteration proposes candidates under the present correction, and asks the reference model for the
    misfit of each. In the end, the mean of the estimates of the iterations without progress is taken: the
    reference model finds no difference between them. Where the estimate `is_hopeless`, an iteration without
    progress ends it.
    """
    reference = reference_problem(objective)
    jacobians: _Jacobians | None = None

    def outcomes_of(current: SearchResult, iteration: int, idle: int) -> list[SearchResult]:
        nonlocal jacobians
        correction = current.outputs_correction
        candidates, jacobians = _candidates(
            current, correction, jacobians if idle else None, iteration, seed, settings
        )
        rng = stream(seed, "reference runs", iteration)
        return compared(current.objective, correction, candidates, reference, rng)

    none = np.zeros_like(objective.target)
    starts = compared(objective, none, points, reference, stream(seed, "reference runs", "starts"))
    best = min(starts, key=lambda one: one.residual_variance)
    resting = with_rests(objective, best.point, reference, stream(seed, "reference runs", "rests"))
    if resting is not objective:
        reference = with_all_phases(reference)
        rng = stream(seed, "reference runs", "start")
        (best,) = compared(resting, none, best.point[np.newaxis], reference, rng)
    end = iterate(best, outcomes_of, max_corrections, settings, on_progress, is_hopeless)
    if on_progress:
        on_progress(1.0)
    return _mean(replace(end.estimate, converged=end.converged), end.equal, settings)


def with_discrepancy(result: SearchResult, seed: int) -> SearchResult:
    """Return an estimate that was searched without correction, with its discrepancy where it can be known."""
    if result.discrepancy is not None or not has_reference(result.objective.problem):
        return result
    known = discrepancies(
        result.objective,
        result.point[np.newaxis],
        result.outputs[np.newaxis],
        reference_problem(result.objective),
        stream(seed, "reference runs"),
    )
    return replace(result, discrepancy=known[0])


def over_all_phases(result: SearchResult, seed: int) -> SearchResult:
    """Return an estimate that was corrected, now by runs whose ripple has all phases.

    As it is where the drive has no hysteresis, or nothing was corrected.
    """
    objective = result.objective
    if objective.problem.actuator.drive_kind != "hysteresis" or not result.correction.any():
        return result
    (known,) = discrepancies(
        objective,
        result.point[np.newaxis],
        result.outputs[np.newaxis],
        with_all_phases(reference_problem(objective)),
        stream(seed, "reference runs of all phases"),
    )
    return replace(result, correction=known.mean, discrepancy=known)


def compared(
    objective: MapObjective, correction: Array, points: Array, reference: Problem, rng: np.random.Generator
) -> list[SearchResult]:
    """Return results at `points` (n, d), found under a `correction` (rows,), with their discrepancies."""
    outputs = objective.outputs(points)
    known = discrepancies(objective, points, outputs, reference, rng)
    return [
        SearchResult.at(objective, point, outputs=modelled, correction=correction, discrepancy=one)
        for point, modelled, one in zip(points, outputs, known, strict=True)
    ]


def _candidates(
    current: SearchResult,
    correction: Array,
    before: _Jacobians | None,
    iteration: int,
    seed: int,
    settings: BiasCorrectionSettings,
) -> tuple[Array, _Jacobians]:
    """Return candidates (n, d) under the present `correction`, and the Jacobians that they come from.

    `before` are the Jacobians of an iteration that ended in the same place. A Gauss-Newton step by replicated
    Jacobians leaves the kinks of stick-slip that hold a descent, but may also lead astray.
    """
    objective, space = current.objective, current.objective.space
    descents = LOCAL_SEARCH if before is None else with_descents(settings.further_descents)
    rng = stream(seed, "local search", iteration)
    point = local_search(objective, current.point, correction, rng, descents).best
    jacobians = replicated_jacobians(
        objective.outputs,
        point,
        space,
        settings.jacobian_step,
        settings.replicates if before is None else settings.further_replicates,
        stream(seed, "Jacobians of the correction", iteration),
    )
    if before is not None:
        jacobians = np.concatenate([objective.rescaled(before.values, before.objective), jacobians])
    step = gauss_newton(objective, point, objective.residual(point, correction), jacobians)
    step *= min(1.0, settings.longest_step / max(float(np.linalg.norm(step)), settings.longest_step))
    shares = np.array(settings.step_shares)[:, np.newaxis]
    return space.project(point + shares * step), _Jacobians(objective, jacobians)


def gauss_newton(objective: MapObjective, point: Array, residual: Array, jacobians: Array) -> Array:
    """Return the step (d,) to the optimum of a linear model, by the mean of the Jacobians.

    A fault has no prior; as far as the channels do not show it, it keeps its value.
    """
    space, rows = objective.space, objective.channel_rows
    normal, gradient = normal_equations(jacobians[:, :, :rows], residual[:rows], space.prior_deviations)
    # Priors are exact: along what the channels do not show, they alone lead.
    priors = objective.jacobian_of_priors
    normal = normal + priors @ priors.T
    gradient = gradient + priors @ residual[rows:]
    faults = np.arange(len(space.columns))
    normal[faults, faults] += float(np.mean(residual**2)) * CORRELATED_ROWS / PRIOR_DEVIATION**2
    return bounded_step(normal, gradient, point, space)


def _mean(
    current: SearchResult, equal: Sequence[SearchResult], settings: BiasCorrectionSettings
) -> SearchResult:
    """Return the mean of estimates of equal misfit, if its own misfit is no larger than theirs.

    What they scatter is the optimiser scatter covariance.
    """
    if len(equal) < 2:
        return current
    equal = [one.weighted_as(current.objective) for one in equal]
    points = np.array([one.point for one in equal])
    point, scatter = points.mean(axis=0), np.cov(points, rowvar=False)
    known = [one.discrepancy for one in equal if one.discrepancy is not None]
    assert current.discrepancy is not None  # noqa: S101 - every result of a correction has one
    mean = replace(
        current,
        point=point,
        known_outputs=None,
        correction=np.mean([one.correction for one in equal], axis=0),
        discrepancy=replace(current.discrepancy, mean=np.mean([one.mean for one in known], axis=0)),
        scatter=scatter / len(equal),
    )
    if mean.misfit <= settings.equal_misfits * current.misfit:
        return mean
    return replace(current, scatter=scatter)
