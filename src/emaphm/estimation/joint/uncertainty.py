"""How well a joint fit knows the shared parameters, and what the recordings contradict each other in."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.bias_correction import gauss_newton
from emaphm.estimation.joint.correction import JointEstimate
from emaphm.estimation.joint.random_effects import MetaAnalysis, random_effects
from emaphm.estimation.joint.search import DESCENT, SEARCH, settle
from emaphm.estimation.levenberg_marquardt import least_squares
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.uncertainty.covariance import ScoreStatistics, score_statistics
from emaphm.estimation.uncertainty.fisher_information import information
from emaphm.estimation.uncertainty.local_covariance import (
    jacobians_at,
    local_covariance,
    response_of,
    rounding_scores,
)
from emaphm.estimation.uncertainty.repeated_errors import RepeatedErrors, ScoreSeries, repeated_errors
from emaphm.estimation.uncertainty.switching_scores import switching_errors, switching_scores
from emaphm.random_streams import stream

FAR = 2.0
"""Ratio of squared residuals, at the joint estimate and after a descent, from which a recording alone is
too far from the joint fit for a linear model. A descent that gains less may be along what the recording
hardly determines, and end anywhere there."""

STEP_SHARES = np.array([1.0, 0.5, 0.25, 0.1, 0.0])
"""Shares of a Gauss-Newton step that are tried: where data have little information, it may lead astray."""


@dataclass(frozen=True, eq=False)
class AloneEstimates:
    """The shared coordinates that each recording alone asks for.

    `points` (n, p) with `covariances` (n, p, p); `residual_ratios` (n,) are the rms residual of each
    recording in the joint fit over that alone; `meta` is the meta-analysis of them.
    """

    points: Array
    covariances: Array
    residual_ratios: Array
    meta: MetaAnalysis


@dataclass(frozen=True, eq=False)
class JointUncertainty:
    """The end of a joint fit.

    Attributes
    ----------
    point
        The estimate (d,): where the fit ended, and without correction a Gauss-Newton step by replicated
        Jacobians.
    covariance
        Of all coordinates (d, d), from the residuals of all recordings, their correlation included.
    alone
        What each recording would have by itself; None of one recording.
    error_correlation
        How alike the residuals are in recordings that repeat a command, from 0 to 1; None where no more than
        by chance.
    manoeuvres
        How many commands the recordings have; those that repeat one count once.
    """

    point: Array
    covariance: Array
    alone: AloneEstimates | None
    error_correlation: float | None
    manoeuvres: int


def joint_uncertainty(
    estimate: JointEstimate,
    seed: int,
    unresolved: Callable[[int, Array], Array] | None = None,
    alone: AloneEstimates | None = None,
    hidden: Callable[[int, Array], Array | float] = lambda _number, _jacobian: 0.0,
    slow_terms: bool = False,
) -> JointUncertainty:
    """Return how well an estimate is known, and what each recording alone would have.

    `unresolved` returns, of the number of a recording and the shared coordinates (p,) that it alone asks for,
    the covariance (p, p) of what it by principle has no information on. `alone` is known where each recording
    has been searched by itself. `hidden` returns, of the number of a recording and its mean Jacobian (own +
    shared, channel rows), the covariance of that Jacobian times an error that the residual does not show.
    With `slow_terms`, recordings of slow motions have the derivatives of the reference model and the scores
    of its switching, as in a single diagnosis, and the remaining step counts as an error: this takes some 200
    runs of the reference model for each of them.
    """
    joint = estimate.joint
    jacobians = joint.for_each(
        lambda r: jacobians_at(
            joint.terms[r].objective,
            joint.local(r, estimate.point),
            stream(seed, "Jacobians of the covariance", r),
        )
    )
    repeated = _repeated_errors(estimate, jacobians)
    slow = joint.for_each(lambda r: _slow_motion(estimate, r, seed)) if slow_terms else []
    scores = list[_Scores]()
    for r, term in enumerate(joint.terms):
        mean = jacobians[r].mean(axis=0)
        # What the model lacks is the same in each repetition of a manoeuvre.
        unseen = rounding_scores(term.objective.problem, mean) + repeated.repetitions[r] * hidden(r, mean)
        scores.append(_scores_of(estimate, r, jacobians[r], unseen, slow[r] if slow else _SlowMotion()))
    total = ScoreStatistics(
        joint.summed_matrices([one.statistics.information for one in scores]),
        joint.summed_matrices([one.statistics.score_covariance for one in scores])
        + repeated.covariance
        - repeated.independent,
    )
    # Descents stop short of the prior where recordings have little information; a step by all Jacobians
    # does not.
    prior = joint.prior_precisions
    pull = prior * estimate.point
    pull[: joint.faults] = 0.0
    gradient = joint.summed_vectors([one.gradient for one in scores]) - pull
    normal = joint.summed_matrices([one.normal for one in scores])
    is_slow = any(motion.response is not None for motion in slow)
    if is_slow:
        normal = joint.summed_matrices([one.cross for one in scores])
        total = total.answered_by(normal, joint.correlated_rows / joint.prior_deviations**2)
    step = np.asarray(np.linalg.solve(normal + np.diag(prior), gradient), float)
    covariance = total.covariance(joint.prior_deviations, joint.correlated_rows)
    if is_slow:
        remaining = joint.box.project(estimate.point + step) - estimate.point
        covariance = covariance + np.outer(remaining, remaining)
    return JointUncertainty(
        # The iterations of a correction have taken such steps, and the mean of them.
        estimate.point if estimate.corrected else _stepped(estimate, step),
        covariance,
        alone or (_alone(estimate, jacobians, unresolved, seed) if len(joint.terms) > 1 else None),
        repeated.correlation,
        repeated.manoeuvres,
    )


@dataclass(frozen=True, eq=False)
class _SlowMotion:
    """Response and switching of the reference model in a slow motion; None in faster motions.

    `response` (own + shared, channel rows) are the derivatives, `errors` (n, channel rows) the deviations of
    single runs (`switching_errors`).
    """

    response: Array | None = None
    errors: Array | None = None


@dataclass(frozen=True, eq=False)
class _Scores:
    """Terms of one recording: statistics of its scores, normal matrix and gradient of its linear model.

    `cross` (d, d) is the normal matrix with the derivatives of the reference model in a slow motion, in the
    unit of the information.
    """

    statistics: ScoreStatistics
    normal: Array
    gradient: Array
    cross: Array


def _scores_of(
    estimate: JointEstimate, r: int, jacobians: Array, unseen: Array, slow: _SlowMotion
) -> _Scores:
    """Return the terms of recording `r` from its `jacobians` (n, own + shared, channel rows).

    `unseen`, square, is the covariance of the scores of errors that the residual does not show.
    """
    objective, mean = estimate.joint.terms[r].objective, jacobians.mean(axis=0)
    residual = estimate.corrected_residuals[r][: objective.channel_rows]
    variance = np.mean(residual**2)
    unseen = unseen + switching_scores(mean, slow.errors)
    statistics = score_statistics(jacobians, residual, len(objective.problem.channels), unseen)
    cross = statistics.information if slow.response is None else mean @ slow.response.T / variance
    return _Scores(statistics, information(jacobians) / variance, mean @ residual / variance, cross)


def _slow_motion(estimate: JointEstimate, r: int, seed: int) -> _SlowMotion:
    """Return the response and the errors of recording `r` at the joint estimate."""
    discrepancy = estimate.discrepancies[r]
    result = SearchResult.at(
        estimate.joint.terms[r].objective,
        estimate.joint.local(r, estimate.point),
        correction=discrepancy.mean,
        discrepancy=discrepancy,
    )
    return _SlowMotion(
        response_of(result, stream(seed, "Jacobians of the response", r)),
        switching_errors(result, stream(seed, "switching of the covariance", r)),
    )


def _repeated_errors(estimate: JointEstimate, jacobians: Sequence[Array]) -> RepeatedErrors:
    """Return what recordings that repeat a command have in common in their normalised residuals."""
    joint, series = estimate.joint, []
    for r, (term, residual) in enumerate(zip(joint.terms, estimate.corrected_residuals, strict=True)):
        problem, channels = term.objective.problem, residual[: term.objective.channel_rows]
        by_channel = jacobians[r].mean(axis=0) * channels / np.mean(channels**2)
        scores = np.zeros((joint.box.lower.size, problem.samples))
        scores[joint.indices[r]] = by_channel.reshape(len(by_channel), -1, problem.samples).sum(axis=1)
        interval = problem.inputs.interval
        command = problem.driving.command(np.asarray(interval * np.arange(problem.samples), float))
        series.append(ScoreSeries(scores, np.asarray(command, float), interval))
    return repeated_errors(series, np.arange(joint.shared))


def _stepped(estimate: JointEstimate, step: Array) -> Array:
    """Return the end (d,) of the largest share of a Gauss-Newton `step` (d,) that costs nothing."""
    joint = estimate.joint
    points = joint.box.project(estimate.point + STEP_SHARES[:, np.newaxis] * step)
    costs = np.array([one.cost for one in joint.evaluate(points)])
    # The last share is no step at all.
    return np.asarray(points[np.flatnonzero(costs <= SEARCH.equal_costs * costs[-1])[0]])


def _alone(
    estimate: JointEstimate,
    jacobians: Sequence[Array],
    unresolved: Callable[[int, Array], Array] | None,
    seed: int,
) -> AloneEstimates:
    """Return what each recording asks for by itself, under the discrepancy of the joint fit."""
    joint = estimate.joint
    by_term = joint.for_each(lambda r: _alone_of(estimate, r, jacobians[r], seed))
    places = [term.shared_places for term in joint.terms]
    points = np.array([end[at] for (end, _, _), at in zip(by_term, places, strict=True)])
    covariances = np.array(
        [covariance[np.ix_(at, at)] for (_, covariance, _), at in zip(by_term, places, strict=True)]
    )
    ratios = np.array([ratio for _, _, ratio in by_term])
    if unresolved is not None:
        # Errors of Jacobians look like information, even where there is none by principle.
        covariances += np.array([unresolved(r, point) for r, point in enumerate(points)])
    return AloneEstimates(
        points,
        covariances,
        ratios,
        random_effects(points, covariances, joint.prior_deviations[: joint.shared]),
    )


def _alone_of(estimate: JointEstimate, r: int, jacobians: Array, seed: int) -> tuple[Array, Array, float]:
    """Return the estimate (own + shared,) of recording `r` alone, its covariance, and its misfit ratio.

    A Gauss-Newton step from the joint estimate, by its `jacobians`, is free of the kinks that hold a descent.
    Where a descent leads to a fit that is far better all the same, its end counts.
    """
    term, start = estimate.joint.terms[r], estimate.joint.local(r, estimate.point)
    objective, rows = term.objective, term.objective.channel_rows
    correction = estimate.discrepancies[r].mean + term.correction
    together = estimate.corrected_residuals[r][:rows]
    local = local_covariance(objective, start, together, jacobians)
    step = gauss_newton(objective, start, estimate.corrected_residuals[r], jacobians)
    target = objective.target - correction
    # The last share is no step at all: the joint estimate.
    points = objective.space.project(start + STEP_SHARES[:, np.newaxis] * step)
    costs = np.mean((target - objective.outputs(points)) ** 2, axis=1)
    end = points[np.flatnonzero(costs <= SEARCH.equal_costs * costs[-1])[0]]
    found = least_squares(objective.outputs, target, np.array([start, end]), objective.space, DESCENT)
    least = min(float(costs.min()), float(found.costs.min()))
    if costs[-1] > FAR * least:
        return _far_alone(estimate, r, found.best, correction, seed)
    ratio = float(np.sqrt(np.mean(together**2) / max(least, np.finfo(float).tiny)))
    return end, local.covariance, ratio


def _far_alone(
    estimate: JointEstimate, r: int, point: Array, correction: Array, seed: int
) -> tuple[Array, Array, float]:
    """Return what `_alone_of` does where recording `r` is far from the others: fitted by its own residuals.

    `point` (own + shared,) is where a descent under the weights of the joint fit has led.
    """
    joint = estimate.joint
    by_itself = replace(joint, terms=(replace(joint.terms[r], correction=correction),))
    start = np.zeros(point.size)
    start[by_itself.indices[0]] = point
    by_itself, end = settle(by_itself, start)
    (term,), local_end = by_itself.terms, by_itself.local(0, end)
    objective, rows = term.objective, term.objective.channel_rows
    residual = objective.residual(local_end, term.correction)[:rows]
    jacobians = jacobians_at(objective, local_end, stream(seed, "Jacobians of one recording", r))
    local = local_covariance(objective, local_end, residual, jacobians)
    together = objective.rescaled(estimate.corrected_residuals[r], joint.terms[r].objective)[:rows]
    ratio = float(np.sqrt(np.mean(together**2) / max(float(np.mean(residual**2)), np.finfo(float).tiny)))
    return local_end, local.covariance, ratio
