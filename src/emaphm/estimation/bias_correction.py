"""Correction of the fitted model's bias by a few runs of the reference model (docs/physics.md, section 9).

The averaged model is not the reference model, so its best fit is biased. Their discrepancy at the estimate is
added to the averaged model's outputs, and the fit repeated from there: space mapping, or a multi-fidelity
additive correction (Bandler et al. 2004; March and Willcox 2012).
"""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.discrepancy import discrepancies, has_reference, reference_problem
from emaphm.estimation.finite_differences import replicated_jacobians
from emaphm.estimation.global_search.multistart import LOCAL_SEARCH, local_search, with_descents
from emaphm.estimation.levenberg_marquardt import movable
from emaphm.estimation.objective import CORRELATED_ROWS, MapObjective
from emaphm.estimation.parameter_space import PRIOR_DEVIATION
from emaphm.estimation.problem import Problem
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.uncertainty.fisher_information import information
from emaphm.progress import Progress
from emaphm.random_streams import stream

MAX_CORRECTIONS = 10
"""Most correction iterations; most recordings take 4 to 6."""


@dataclass(frozen=True)
class BiasCorrectionSettings:
    """How an iteration proposes candidates, and when the iterations end; `make study` shows the effect.

    An iteration descends, then takes the `step_shares` of a Gauss-Newton step by `replicates` Jacobians over
    differences of `jacobian_step`, `longest_step` at most. One that follows an iteration without progress
    adds `further_replicates` to them, and makes `further_descents`. Misfits within the factor `equal_misfits`
    count as equal: switching alone changes a misfit by about 10 %. Progress is a misfit below `progress`
    times the one before; after `patience` iterations without, the correction has converged.
    """

    step_shares: tuple[float, ...] = (0.0, 0.3, 1.0)
    jacobian_step: float = 2e-2
    replicates: int = 4
    longest_step: float = 0.1
    further_descents: int = 2
    further_replicates: int = 2
    equal_misfits: float = 1.2
    progress: float = 0.9
    patience: int = 3


BIAS_CORRECTION = BiasCorrectionSettings()

FROM_STARTS = BiasCorrectionSettings(patience=1)
"""From points that are near the optimum already."""


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
) -> SearchResult:
    """Return the estimate after up to `max_corrections` iterations, from the best of `points` (n, d).

    Each iteration proposes candidates under the present correction, and asks the reference model for the
    misfit of each. It takes the one farthest along whose misfit equals the least, so never one that is worse
    than before by more than switching makes. In the end, the mean of the estimates of the iterations without
    progress is taken: the reference model finds no difference between them.
    """
    reference = reference_problem(objective)
    none = np.zeros_like(objective.target)
    starts = compared(objective, none, points, reference, stream(seed, "reference runs", "starts"))
    current = min(starts, key=lambda one: one.residual_variance)
    idle, equal, jacobians = 0, list[SearchResult](), None
    for iteration in range(max_corrections):
        current = current.reweighted()
        correction = current.outputs_correction
        candidates, jacobians = _candidates(
            current, correction, jacobians if idle else None, iteration, seed, settings
        )
        rng = stream(seed, "reference runs", iteration)
        outcomes = compared(current.objective, correction, candidates, reference, rng)
        misfits = np.array([one.misfit for one in outcomes])
        farthest = int(np.flatnonzero(misfits <= settings.equal_misfits * misfits.min())[-1])
        idle = 0 if misfits[farthest] < settings.progress * current.misfit else idle + 1
        if misfits[farthest] <= settings.equal_misfits * current.misfit:
            current = outcomes[farthest]
            equal = [*equal, current] if idle else []
        if idle == settings.patience:
            current = replace(current, converged=True)
            break
        if on_progress:
            on_progress((iteration + 1) / max_corrections)
    if on_progress:
        on_progress(1.0)
    return _mean(current, equal, settings)


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
    """Return the step (d,) to the optimum of a linear model, by the mean of the Jacobians."""
    gradient = jacobians.mean(axis=0) @ residual
    cost = float(np.mean(residual**2))
    prior = cost * CORRELATED_ROWS / PRIOR_DEVIATION**2
    normal = information(jacobians) + prior * np.eye(point.size)
    free = movable(point, gradient, objective.space)
    step = np.zeros(point.size)
    step[free] = np.linalg.solve(normal[np.ix_(free, free)], gradient[free])
    return step


def _mean(current: SearchResult, equal: list[SearchResult], settings: BiasCorrectionSettings) -> SearchResult:
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
