"""Correction of the fitted model's bias in a joint fit, by runs of the reference model.

The method is that of `emaphm.estimation.bias_correction` for one recording: every recording has its own
discrepancy at the common point, which is added to its outputs while all recordings are fitted again.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.correction_iterations import BIAS_CORRECTION, iterate
from emaphm.estimation.discrepancy import Discrepancy, discrepancies, has_reference, reference_problem
from emaphm.estimation.finite_differences import replicated_jacobians
from emaphm.estimation.global_search.multistart import MULTISTART, with_perturbed
from emaphm.estimation.joint.objective import JointObjective, RecordingTerm
from emaphm.estimation.levenberg_marquardt import bounded_step, descend
from emaphm.estimation.search_result import default_scatter
from emaphm.estimation.standstill import with_rests
from emaphm.estimation.uncertainty.fisher_information import products, steadied_information
from emaphm.progress import Progress
from emaphm.random_streams import stream


@dataclass(frozen=True, eq=False)
class JointEstimate:
    """A `point` (d,) of a joint fit, and the discrepancy of each recording at this point.

    `residuals` are measured minus modelled, (rows,) of each recording, with the weights of its objective;
    minus the discrepancy, they have no bias. `scatter` is the covariance (d, d) of the optimiser's end
    points.
    """

    joint: JointObjective
    point: Array
    residuals: tuple[Array, ...]
    discrepancies: tuple[Discrepancy, ...]
    scatter: Array

    @property
    def corrected_residuals(self) -> list[Array]:
        """Measured minus reference model, (rows,) of each recording."""
        pairs = zip(self.residuals, self.discrepancies, strict=True)
        return [residual - discrepancy.mean for residual, discrepancy in pairs]

    @property
    def corrected(self) -> bool:
        """Whether the reference model was run."""
        return any(np.any(discrepancy.standard_error) for discrepancy in self.discrepancies)

    @property
    def primary_variance(self) -> float:
        """The mean over recordings of the squared corrected residual of the primary channel, in its unit²."""
        squares = []
        for term, residual in zip(self.joint.terms, self.corrected_residuals, strict=True):
            problem = term.objective.problem
            squares.append(np.mean((residual[: problem.samples] / problem.weights[0]) ** 2))
        return float(np.mean(squares))

    @property
    def misfit(self) -> float:
        """The sum of squared normalised residuals minus that of the discrepancies' errors, at least 0."""
        total = 0.0
        for term, residual, known in zip(
            self.joint.terms, self.corrected_residuals, self.discrepancies, strict=True
        ):
            square = float(np.sum(residual**2) - np.sum(known.standard_error**2))
            total += square / term.residual_rms**2
        return max(total, 0.0)

    def reweighted(self) -> Self:
        """Return the estimate with recordings and channels weighted by their residuals."""
        before = self.joint.terms
        biased = [not discrepancy.standard_error.any() for discrepancy in self.discrepancies]
        joint = self.joint.reweighted(self.corrected_residuals, biased)
        pairs = [(new.objective, old.objective) for new, old in zip(joint.terms, before, strict=True)]
        return replace(
            self,
            joint=joint,
            residuals=tuple(
                new.rescaled(residual, old)
                for (new, old), residual in zip(pairs, self.residuals, strict=True)
            ),
            discrepancies=tuple(
                discrepancy.rescaled(new, old)
                for (new, old), discrepancy in zip(pairs, self.discrepancies, strict=True)
            ),
        )


def corrected_estimate(
    joint: JointObjective,
    point: Array,
    max_corrections: int,
    seed: int,
    on_progress: Progress | None = None,
) -> JointEstimate:
    """Return the estimate after up to `max_corrections` by the reference model, from `point` (d,).

    The estimate is not corrected if `max_corrections` is 0 or the reference model cannot run.
    """
    if max_corrections == 0 or not any(has_reference(term.objective.problem) for term in joint.terms):
        return _uncorrected_estimate(joint, point)

    def outcomes_of(current: JointEstimate, iteration: int, _idle: int) -> list[JointEstimate]:
        candidates = _candidates(current, iteration, seed)
        return compared(current.joint, candidates, seed, iteration)

    joint = _with_rests(joint, point, seed)
    (start,) = compared(joint, point[np.newaxis], seed, "start")
    end = iterate(start, outcomes_of, max_corrections, on_progress)
    return _mean(end.estimate, end.equal)


def _with_rests(joint: JointObjective, point: Array, seed: int) -> JointObjective:
    """Return the objective without the random part of the channels' means in the rests at `point` (d,)."""

    def of_term(r: int) -> RecordingTerm:
        term = joint.terms[r]
        objective = term.objective
        if not has_reference(objective.problem):
            return term
        rng = stream(seed, "reference runs", "rests", r)
        resting = with_rests(objective, joint.local(r, point), reference_problem(objective), rng)
        return replace(term, objective=resting)

    return replace(joint, terms=tuple(joint.for_each(of_term)))


def _uncorrected_estimate(joint: JointObjective, point: Array) -> JointEstimate:
    """Return the estimate at `point` (d,) with discrepancies of 0."""
    residuals = joint.residuals(point)
    zero = tuple(_zero_discrepancy(residual) for residual in residuals)
    return JointEstimate(joint, point, tuple(residuals), zero, default_scatter(point.size))


def _zero_discrepancy(rows: Array) -> Discrepancy:
    """Return a discrepancy of 0 with the shape of `rows`."""
    return Discrepancy(np.zeros_like(rows), np.zeros_like(rows), 0.0, runs=1)


def can_be_compared(joint: JointObjective) -> bool:
    """Return whether the reference model can run for all recordings."""
    return all(has_reference(term.objective.problem) for term in joint.terms)


def compared(joint: JointObjective, points: Array, seed: int, *name: str | int) -> list[JointEstimate]:
    """Return the estimates at `points` (n, d) with their discrepancies."""

    def of_term(r: int) -> tuple[Array, list[Discrepancy]]:
        objective, local = joint.terms[r].objective, points[:, joint.indices[r]]
        outputs = objective.outputs(local)
        if not has_reference(objective.problem):
            return outputs, [_zero_discrepancy(outputs[0]) for _ in points]
        rng = stream(seed, "reference runs", *name, r)
        return outputs, discrepancies(objective, local, outputs, reference_problem(objective), rng)

    by_term = joint.for_each(of_term)
    return [
        JointEstimate(
            joint,
            point,
            tuple(
                term.objective.target - outputs[i]
                for term, (outputs, _) in zip(joint.terms, by_term, strict=True)
            ),
            tuple(known[i] for _, known in by_term),
            default_scatter(point.size),
        )
        for i, point in enumerate(points)
    ]


def _candidates(current: JointEstimate, iteration: int, seed: int) -> Array:
    """Return candidates (n, d) under the current correction: a descent's end and Gauss-Newton steps from it.

    A step by replicated Jacobians leaves a local minimum at a kink of stick-slip, at which a descent stops,
    but may also increase the misfit.
    """
    joint = current.joint.corrected([discrepancy.mean for discrepancy in current.discrepancies])
    rng = stream(seed, "local search", iteration)
    starts = with_perturbed(current.point, rng)
    point = descend(joint, starts, joint.box, MULTISTART.fine).best
    step = _gauss_newton(joint, point, iteration, seed)
    return joint.box.project(point + BIAS_CORRECTION.steps_along(step))


def _gauss_newton(joint: JointObjective, point: Array, iteration: int, seed: int) -> Array:
    """Return the step (d,) to the optimum of a linear model with the means of replicated Jacobians."""
    count = BIAS_CORRECTION.replicates

    def of_term(r: int) -> tuple[Array, Array]:
        term, local = joint.terms[r], joint.local(r, point)
        rows = term.objective.channel_rows
        jacobians = replicated_jacobians(
            lambda points: term.outputs(points)[:, :rows],
            local,
            term.objective.space,
            BIAS_CORRECTION.jacobian_step,
            count,
            stream(seed, "Jacobians of the correction", iteration, r),
        )
        residual = (term.target - term.outputs(local[np.newaxis])[0])[:rows]
        return products(jacobians), jacobians.mean(axis=0) @ residual

    by_term = joint.for_each(of_term)
    replicates, total = np.arange(count), np.zeros((count, point.size) * 2)
    for index, (of_term_products, _) in zip(joint.indices, by_term, strict=True):
        total[np.ix_(replicates, index, replicates, index)] += of_term_products
    normal = steadied_information(total, joint.prior_deviations)
    gradient = joint.summed_vectors([vector for _, vector in by_term])
    # A fault has no prior mean; directions that the recordings do not constrain keep the fault's value.
    prior = joint.prior_precisions
    normal += np.diag(prior)
    gradient[joint.faults :] -= (prior * point)[joint.faults :]
    return bounded_step(normal, gradient, point, joint.box)


def _mean(current: JointEstimate, equal: Sequence[JointEstimate]) -> JointEstimate:
    """Return the mean of estimates of `equal` misfit, between which the reference model does not decide."""
    if len(equal) < 2:
        return current
    joint, points = current.joint, np.array([estimate.point for estimate in equal])
    point, scatter = points.mean(axis=0), np.atleast_2d(np.cov(points, rowvar=False)) / len(equal)
    known = []
    for r, (term, latest) in enumerate(zip(joint.terms, current.discrepancies, strict=True)):
        means = [
            term.objective.rescaled(estimate.discrepancies[r].mean, estimate.joint.terms[r].objective)
            for estimate in equal
        ]
        known.append(replace(latest, mean=np.mean(means, axis=0)))
    uncorrected = joint.corrected([np.zeros_like(discrepancy.mean) for discrepancy in known])
    return JointEstimate(joint, point, tuple(uncorrected.residuals(point)), tuple(known), scatter)
