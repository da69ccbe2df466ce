"""Objective function of a joint fit: residuals of all recordings, with shared and own coordinates.

The residuals of a recording depend only on the shared coordinates and on its own coordinates, so the normal
matrix of all recordings has the shape of an arrow. Each recording is simulated only for the coordinates that
act on it; costs, gradients and normal matrices of the recordings are added.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.estimation.finite_differences import one_sided_jacobians
from emaphm.estimation.levenberg_marquardt import Evaluation
from emaphm.estimation.objective import CORRELATED_ROWS, MapObjective
from emaphm.estimation.space.parameter_space import Box, ParameterSpace
from emaphm.estimation.space.parameter_variation import ParameterVariation
from emaphm.threads import in_threads

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class RecordingTerm:
    """The term of one recording in a joint fit.

    The coordinates of its `objective` are the faults, its own coordinates, and the deviations of the unit;
    `shared` is the number of faults and deviations. `correction`, (rows,), is added to the model's outputs
    and has the same weights.
    """

    objective: MapObjective
    shared: int
    correction: Array

    @classmethod
    def of(cls, objective: MapObjective, shared: int) -> Self:
        """Return the term without correction."""
        return cls(objective, shared, np.zeros_like(objective.target))

    @property
    def own(self) -> int:
        """The number of the recording's own coordinates."""
        return self.objective.space.dimensions - self.shared

    @property
    def faults(self) -> int:
        """The number of faults, its first coordinates; 0 for a unit that is known to be healthy."""
        return len(self.objective.space.columns)

    @property
    def shared_places(self) -> NDArray[np.intp]:
        """The indices of the shared coordinates among those of the recording's objective."""
        places = np.arange(self.objective.space.dimensions)
        return np.asarray(np.delete(places, slice(self.faults, self.faults + self.own)))

    @property
    def rows(self) -> int:
        """The number of rows of its residual: the channels, and the prior of its own coordinates."""
        return self.objective.channel_rows + self.own

    @property
    def residual_rms(self) -> float:
        """The rms residual [A] by which its rows are divided, to residuals of size 1 in all recordings."""
        return self.objective.residual_rms

    @property
    def target(self) -> Array:
        """The target of `outputs`, (rows,)."""
        return (self.objective.target - self.correction)[: self.rows] / self.residual_rms

    def outputs(self, points: Array) -> Array:
        """Return the normalised rows at the recording's coordinates `points` (n, own + shared)."""
        return self.objective.outputs(points)[:, : self.rows] / self.residual_rms

    def reweighted(self, residual: Array, *, biased: bool) -> Self:
        """Return the term with channels weighted by a `residual` (rows,) with the objective's weights."""
        objective = self.objective.reweighted(residual, biased=biased)
        return replace(
            self, objective=objective, correction=objective.rescaled(self.correction, self.objective)
        )


@dataclass(frozen=True, eq=False)
class JointBox(Box):
    """The bounds of all coordinates; faults also have the bounds of one recording's `space`.

    `index` are the coordinates of a point that belong to that space.
    """

    space: ParameterSpace
    index: NDArray[np.intp]

    def project(self, points: Array) -> Array:
        """Return `points` (…, d) moved into the bounds and the eccentricity into its circle."""
        points = np.array(points, float)
        points[..., self.index] = self.space.project(points[..., self.index])
        return np.clip(points, self.lower, self.upper)


@dataclass(frozen=True, eq=False)
class JointObjective:
    """The terms of all recordings of one unit, and the deviations `unit` from its description.

    A point contains the faults, the unit's deviations (both shared), and then the own coordinates of each
    recording. `step` is that of the finite differences; `workers` is the number of threads, None for one per
    core.
    """

    terms: tuple[RecordingTerm, ...]
    unit: ParameterVariation
    step: float
    workers: int | None = None

    @property
    def shared(self) -> int:
        """The number of shared coordinates, p, which are the first of every point."""
        return self.faults + self.unit.priors.size

    @property
    def faults(self) -> int:
        """The number of faults, which are the first shared coordinates."""
        return self.terms[0].faults

    @cached_property
    def indices(self) -> tuple[NDArray[np.intp], ...]:
        """The indices of each recording's coordinates in a point, in the order of its own objective."""
        first, indices = self.shared, []
        for term in self.terms:
            indices.append(np.r_[: self.faults, first : first + term.own, self.faults : self.shared])
            first += term.own
        return tuple(indices)

    @cached_property
    def box(self) -> JointBox:
        """The bounds of a point."""
        lower, upper = (
            self._gathered([getattr(term.objective.space, side) for term in self.terms])
            for side in ("lower", "upper")
        )
        return JointBox(lower, upper, self.terms[0].objective.space, self.indices[0])

    @cached_property
    def prior_deviations(self) -> Array:
        """The prior standard deviation of each coordinate, (d,)."""
        return self._gathered([term.objective.space.prior_deviations for term in self.terms])

    @cached_property
    def correlated_rows(self) -> Array:
        """The number of rows that count as one observation for each coordinate, (d,).

        For shared coordinates, it is the mean over the recordings.
        """
        by_term = [term.objective.correlated_rows for term in self.terms]
        count = self._gathered(
            [np.full(term.own + term.shared, n) for term, n in zip(self.terms, by_term, strict=True)]
        )
        count[: self.shared] = np.mean(by_term)
        return count

    @cached_property
    def rows_of_priors(self) -> Array:
        """The number of rows that count as one observation against the prior of each coordinate, (d,)."""
        count = self.correlated_rows.copy()
        count[: self.faults] = CORRELATED_ROWS
        return count

    @property
    def prior_precisions(self) -> Array:
        """The term of each coordinate's prior in the normal matrix of normalised residuals, (d,)."""
        return np.asarray(self.rows_of_priors / self.prior_deviations**2)

    def _gathered(self, by_term: Sequence[Array]) -> Array:
        """Return values (d,) of all coordinates from those of each recording."""
        values = np.empty(max(index.max() for index in self.indices) + 1)
        for index, of_term in zip(self.indices, by_term, strict=True):
            values[index] = of_term
        return values

    def for_each(self, function: Callable[[int], T]) -> list[T]:
        """Return `function` of the index of each recording, evaluated in parallel."""
        return in_threads(function, range(len(self.terms)), self.workers)

    def evaluate(self, points: Array) -> list[Evaluation]:
        """Return the evaluations of `points` (n, d): sums of squared normalised residuals and priors."""
        residuals = self.for_each(
            lambda r: self.terms[r].target - self.terms[r].outputs(points[:, self.indices[r]])
        )
        costs = np.sum([np.sum(of_term**2, axis=1) for of_term in residuals], axis=0)
        costs = costs + self._prior_cost(points)
        return [
            Evaluation(point, float(cost), tuple(of_term[i] for of_term in residuals))
            for i, (point, cost) in enumerate(zip(points, costs, strict=True))
        ]

    def _prior_cost(self, points: Array) -> Array:
        """Return the costs (n,) of the priors of the unit's deviations at `points` (n, d)."""
        shared = points[:, self.faults : self.shared] / self.unit.priors
        return np.asarray(np.sum(self.rows_of_priors[self.faults : self.shared] * shared**2, axis=1))

    def normal_equations(self, about: Sequence[Evaluation]) -> list[tuple[Array, Array]]:
        """Return J Jᵀ (d, d) and J r (d,) at each evaluated point, including priors of shared coordinates."""
        points = np.stack([evaluation.point for evaluation in about])

        def of_term(r: int) -> list[tuple[Array, Array]]:
            term, local = self.terms[r], points[:, self.indices[r]]
            residuals = np.stack([evaluation.residual[r] for evaluation in about])
            jacobians = one_sided_jacobians(
                term.outputs, local, term.target - residuals, term.objective.space, self.step
            )
            return [(j @ j.T, j @ residual) for j, residual in zip(jacobians, residuals, strict=True)]

        by_term = self.for_each(of_term)
        return [
            (
                self.summed_matrices([equations[i][0] for equations in by_term]) + self.shared_prior(),
                self.summed_vectors([equations[i][1] for equations in by_term]) - self.shared_prior() @ point,
            )
            for i, point in enumerate(points)
        ]

    def shared_prior(self) -> Array:
        """Return the normal matrix (d, d) of the shared coordinates' prior, for normalised residuals.

        The prior of faults is uniform within their bounds and adds nothing.
        """
        prior, unit = np.zeros(self.box.lower.size), slice(self.faults, self.shared)
        prior[unit] = self.rows_of_priors[unit] / self.unit.priors**2
        return np.diag(prior)

    def summed_matrices(self, by_term: Sequence[Array]) -> Array:
        """Return the sum (d, d) of matrices over each recording's coordinates."""
        total = np.zeros((self.box.lower.size,) * 2)
        for index, matrix in zip(self.indices, by_term, strict=True):
            total[np.ix_(index, index)] += matrix
        return total

    def summed_vectors(self, by_term: Sequence[Array]) -> Array:
        """Return the sum (d,) of vectors over each recording's coordinates."""
        total = np.zeros(self.box.lower.size)
        for index, vector in zip(self.indices, by_term, strict=True):
            total[index] += vector
        return total

    def local(self, r: int, point: Array) -> Array:
        """Return the coordinates (own + shared,) of recording `r` in a `point` (d,)."""
        return point[self.indices[r]]

    def residuals(self, point: Array) -> list[Array]:
        """Return measured minus corrected model of each recording at `point` (d,), weighted, (rows,)."""
        return self.for_each(
            lambda r: self.terms[r].objective.residual(self.local(r, point), self.terms[r].correction)
        )

    def reweighted(self, residuals: Sequence[Array], biased: Sequence[bool]) -> Self:
        """Return the objective with each recording and channel weighted by its residual.

        A `biased` residual contains the bias of the model (`MapObjective.reweighted`).
        """
        terms = tuple(
            term.reweighted(residual, biased=flag)
            for term, residual, flag in zip(self.terms, residuals, biased, strict=True)
        )
        return replace(self, terms=terms)

    def corrected(self, corrections: Sequence[Array]) -> Self:
        """Return the objective with these `corrections`, (rows,) of each recording."""
        pairs = zip(self.terms, corrections, strict=True)
        return replace(self, terms=tuple(replace(term, correction=correction) for term, correction in pairs))
