"""Correction of the fitted model's bias in a joint fit, by runs of the reference model.

As `emaphm.estimation.bias_correction` for one recording: every recording has a discrepancy of its own at the
common point, which is added to its outputs while all are fitted again.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.correction_iterations import BIAS_CORRECTION, iterate
from emaphm.estimation.discrepancy import Discrepancy, discrepancies, has_reference, reference_problem
from emaphm.estimation.finite_differences import replicated_jacobians
from emaphm.estimation.global_search.multistart import LOCAL_SEARCH, MULTISTART
from emaphm.estimation.joint.objective import JointObjective, RecordingTerm
from emaphm.estimation.levenberg_marquardt import bounded_step, descend
from emaphm.estimation.search_result import default_scatter
from emaphm.estimation.standstill import with_rests
from emaphm.estimation.uncertainty.fisher_information import products, steadied_information
from emaphm.progress import Progress
from emaphm.random_streams import stream


@dataclass(frozen=True, eq=False)
class JointEstimate:
    """A `point` (d,) of a joint fit, and the discrepancy of each recording there.

    `residuals` are measured less model, (rows,) of each recording, as its objective weights them; those with
    the discrepancy have no bias. `scatter` is the covariance (d, d) of the optimiser's end points.
    """

    joint: JointObjective
    point: Array
    residuals: tuple[Array, ...]
    discrepancies: tuple[Discrepancy, ...]
    scatter: Array

    @property
    def corrected_residuals(self) -> list[Array]:
        """Measured less reference model, (rows,) of each recording."""
        both = zip(self.residuals, self.discrepancies, strict=True)
        return [residual - discrepancy.mean for residual, discrepancy in both]

    @property
    def corrected(self) -> bool:
        """Whether the reference model was asked."""
        return any(np.any(one.standard_error) for one in self.discrepancies)

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
        """The sum of squared normalised residuals less the share of the discrepancies' errors, 0 at least."""
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
        biased = [not one.standard_error.any() for one in self.discrepancies]
        joint = self.joint.reweighted(self.corrected_residuals, biased)
        pairs = [(new.objective, old.objective) for new, old in zip(joint.terms, before, strict=True)]
        return replace(
            self,
            joint=joint,
            residuals=tuple(
                new.rescaled(one, old) for (new, old), one in zip(pairs, self.residuals, strict=True)
            ),
            discrepancies=tuple(
                one.rescaled(new, old) for (new, old), one in zip(pairs, self.discrepancies, strict=True)
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

    Without any where none is asked for, or the reference model cannot run.
    """
    if max_corrections == 0 or not any(has_reference(term.objective.problem) for term in joint.terms):
        return _uncorrected(joint, point)

    def outcomes_of(current: JointEstimate, iteration: int, _idle: int) -> list[JointEstimate]:
        candidates = _candidates(current, iteration, seed)
        return compared(current.joint, candidates, seed, iteration)

    joint = _with_rests(joint, point, seed)
    (start,) = compared(joint, point[np.newaxis], seed, "start")
    end = iterate(start, outcomes_of, max_corrections, BIAS_CORRECTION, on_progress)
    return _mean(end.estimate, end.equal)


def _with_rests(joint: JointObjective, point: Array, seed: int) -> JointObjective:
    """Return the objective that leaves out what is chance where shafts stand at `point` (d,)."""

    def of_term(r: int) -> RecordingTerm:
        term = joint.terms[r]
        objective = term.objective
        if not has_reference(objective.problem):
            return term
        rng = stream(seed, "reference runs", "rests", r)
        resting = with_rests(objective, joint.local(r, point), reference_problem(objective), rng)
        return replace(term, objective=resting)

    return replace(joint, terms=tuple(joint.for_each(of_term)))


def _uncorrected(joint: JointObjective, point: Array) -> JointEstimate:
    residuals = joint.residuals(point)
    none = tuple(_none(one) for one in residuals)
    return JointEstimate(joint, point, tuple(residuals), none, default_scatter(point.size))


def _none(rows: Array) -> Discrepancy:
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
            return outputs, [_none(outputs[0]) for _ in points]
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
    """Return candidates (n, d) under the present correction: a descent's end, and Gauss-Newton steps from it.

    A step by replicated Jacobians leaves the kinks of stick-slip that hold a descent, but may lead astray.
    """
    joint = current.joint.corrected([one.mean for one in current.discrepancies])
    rng = stream(seed, "local search", iteration)
    perturbation = rng.normal(
        0.0, LOCAL_SEARCH.candidate_separation, (LOCAL_SEARCH.descents - 1, current.point.size)
    )
    starts = np.vstack([current.point, current.point + perturbation])
    point = descend(joint, starts, joint.box, MULTISTART.fine).best
    step = _gauss_newton(joint, point, iteration, seed)
    longest = BIAS_CORRECTION.longest_step
    step *= min(1.0, longest / max(float(np.linalg.norm(step)), longest))
    shares = np.array(BIAS_CORRECTION.step_shares)[:, np.newaxis]
    return joint.box.project(point + shares * step)


def _gauss_newton(joint: JointObjective, point: Array, iteration: int, seed: int) -> Array:
    """Return the step (d,) to the optimum of a linear model, by the means of replicated Jacobians."""
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
    for index, (one, _) in zip(joint.indices, by_term, strict=True):
        total[np.ix_(replicates, index, replicates, index)] += one
    normal = steadied_information(total, joint.prior_deviations)
    gradient = joint.summed_vectors([one for _, one in by_term])
    # A fault has no prior; as far as the recordings do not show it, it keeps its value.
    prior = joint.prior_precisions
    normal += np.diag(prior)
    gradient[joint.faults :] -= (prior * point)[joint.faults :]
    return bounded_step(normal, gradient, point, joint.box)


def _mean(current: JointEstimate, equal: Sequence[JointEstimate]) -> JointEstimate:
    """Return the mean of the estimates that the reference model finds no difference between."""
    if len(equal) < 2:
        return current
    joint, points = current.joint, np.array([one.point for one in equal])
    point, scatter = points.mean(axis=0), np.atleast_2d(np.cov(points, rowvar=False)) / len(equal)
    known = []
    for r, (term, latest) in enumerate(zip(joint.terms, current.discrepancies, strict=True)):
        means = [
            term.objective.rescaled(one.discrepancies[r].mean, one.joint.terms[r].objective) for one in equal
        ]
        known.append(replace(latest, mean=np.mean(means, axis=0)))
    plain = joint.corrected([np.zeros_like(one.mean) for one in known])
    return JointEstimate(joint, point, tuple(plain.residuals(point)), tuple(known), scatter)
