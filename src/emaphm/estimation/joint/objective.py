"""The objective of a joint fit: residuals of all recordings, of what they share and of what is their own.

A recording's residuals depend on the shared coordinates and on its own, so that the Jacobian of all has the
shape of an arrow. Each recording is simulated for the coordinates that act on it alone; what all have on a
point are sums.
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
    """One recording's share of a joint fit.

    The coordinates of its `objective` are the faults, its own ones, and the deviations of the unit; faults
    and deviations are the `shared` ones. `correction`, (rows,), is added to the model's outputs, weighted as
    they are.
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
        """The number of faults, the first of its coordinates; 0 for a unit that is known to be healthy."""
        return len(self.objective.space.columns)

    @property
    def shared_places(self) -> NDArray[np.intp]:
        """The places of the shared coordinates among its own objective's."""
        places = np.arange(self.objective.space.dimensions)
        return np.asarray(np.delete(places, slice(self.faults, self.faults + self.own)))

    @property
    def rows(self) -> int:
        """The rows of its residual: the channels, and the prior of its own coordinates."""
        return self.objective.channel_rows + self.own

    @property
    def residual_rms(self) -> float:
        """The residual [A] that its rows are divided by, so that all recordings have residuals of size 1."""
        return self.objective.residual_rms

    @property
    def target(self) -> Array:
        """What `outputs` should be, (rows,)."""
        return (self.objective.target - self.correction)[: self.rows] / self.residual_rms

    def outputs(self, points: Array) -> Array:
        """Return the normalised rows at the recording's coordinates `points` (n, own + shared)."""
        return self.objective.outputs(points)[:, : self.rows] / self.residual_rms

    def reweighted(self, residual: Array, *, biased: bool) -> Self:
        """Return the term with channels weighted by a `residual` as the objective weights it, (rows,)."""
        objective = self.objective.reweighted(residual, biased=biased)
        return replace(
            self, objective=objective, correction=objective.rescaled(self.correction, self.objective)
        )


@dataclass(frozen=True, eq=False)
class JointBox(Box):
    """The bounds of all coordinates, and of the faults among them as one recording's `space` has them.

    `index` are the coordinates of a point that the space is about.
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
    """Terms of all recordings, of one unit: its faults, and its deviations `unit` from the description.

    A point has the shared coordinates first, the faults first of all, then those of each recording. `step` is
    that of the finite differences; `workers` is the number of threads, one a core where None.
    """

    terms: tuple[RecordingTerm, ...]
    unit: ParameterVariation
    step: float
    workers: int | None = None

    @property
    def shared(self) -> int:
        """The number of shared coordinates, p; the first of every point."""
        return self.faults + self.unit.priors.size

    @property
    def faults(self) -> int:
        """The number of faults; the first of the shared coordinates."""
        return self.terms[0].faults

    @cached_property
    def indices(self) -> tuple[NDArray[np.intp], ...]:
        """The coordinates of a point that each recording has, in the order of its own objective."""
        first, found = self.shared, []
        for term in self.terms:
            found.append(np.r_[: self.faults, first : first + term.own, self.faults : self.shared])
            first += term.own
        return tuple(found)

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
        """The standard deviation of each coordinate before the data, (d,)."""
        return self._gathered([term.objective.space.prior_deviations for term in self.terms])

    @cached_property
    def correlated_rows(self) -> Array:
        """How many rows count as one observation where each coordinate matters, (d,).

        Of what the recordings share, the mean of theirs.
        """
        by_term = [term.objective.correlated_rows for term in self.terms]
        count = self._gathered(
            [np.full(one.own + one.shared, n) for one, n in zip(self.terms, by_term, strict=True)]
        )
        count[: self.shared] = np.mean(by_term)
        return count

    @cached_property
    def rows_of_priors(self) -> Array:
        """How many rows count as one observation against the prior of each coordinate, (d,)."""
        count = self.correlated_rows.copy()
        count[: self.faults] = CORRELATED_ROWS
        return count

    @property
    def prior_precisions(self) -> Array:
        """What the prior of each coordinate adds to the normal matrix of normalised residuals, (d,)."""
        return np.asarray(self.rows_of_priors / self.prior_deviations**2)

    def _gathered(self, by_term: Sequence[Array]) -> Array:
        """Return values (d,) of all coordinates from those of each recording."""
        values = np.empty(max(index.max() for index in self.indices) + 1)
        for index, one in zip(self.indices, by_term, strict=True):
            values[index] = one
        return values

    def for_each(self, function: Callable[[int], T]) -> list[T]:
        """Return `function` of the number of each recording, several at once."""
        return in_threads(function, range(len(self.terms)), self.workers)

    def evaluate(self, points: Array) -> list[Evaluation]:
        """Return the sum of squared normalised residuals and priors at `points` (n, d)."""
        residuals = self.for_each(
            lambda r: self.terms[r].target - self.terms[r].outputs(points[:, self.indices[r]])
        )
        costs = np.sum([np.sum(one**2, axis=1) for one in residuals], axis=0) + self._prior_cost(points)
        return [
            Evaluation(point, float(cost), tuple(one[i] for one in residuals))
            for i, (point, cost) in enumerate(zip(points, costs, strict=True))
        ]

    def _prior_cost(self, points: Array) -> Array:
        shared = points[:, self.faults : self.shared] / self.unit.priors
        return np.asarray(np.sum(self.rows_of_priors[self.faults : self.shared] * shared**2, axis=1))

    def normal_equations(self, about: Sequence[Evaluation]) -> list[tuple[Array, Array]]:
        """Return J Jᵀ (d, d) and J r (d,) about each of some points, the priors of shared coordinates in."""
        points = np.stack([one.point for one in about])

        def of_term(r: int) -> list[tuple[Array, Array]]:
            term, local = self.terms[r], points[:, self.indices[r]]
            residuals = np.stack([one.residual[r] for one in about])
            jacobians = one_sided_jacobians(
                term.outputs, local, term.target - residuals, term.objective.space, self.step
            )
            return [(j @ j.T, j @ residual) for j, residual in zip(jacobians, residuals, strict=True)]

        by_term = self.for_each(of_term)
        return [
            (
                self.summed_matrices([one[i][0] for one in by_term]) + self.shared_prior(),
                self.summed_vectors([one[i][1] for one in by_term]) - self.shared_prior() @ point,
            )
            for i, point in enumerate(points)
        ]

    def shared_prior(self) -> Array:
        """Return the normal matrix (d, d) of the shared coordinates' prior, for normalised residuals.

        Faults have none but their bounds: anywhere in there is as likely beforehand.
        """
        prior, unit = np.zeros(self.box.lower.size), slice(self.faults, self.shared)
        prior[unit] = self.rows_of_priors[unit] / self.unit.priors**2
        return np.diag(prior)

    def summed_matrices(self, by_term: Sequence[Array]) -> Array:
        """Return the sum (d, d) of a matrix of each recording's coordinates."""
        total = np.zeros((self.box.lower.size,) * 2)
        for index, one in zip(self.indices, by_term, strict=True):
            total[np.ix_(index, index)] += one
        return total

    def summed_vectors(self, by_term: Sequence[Array]) -> Array:
        """Return the sum (d,) of a vector of each recording's coordinates."""
        total = np.zeros(self.box.lower.size)
        for index, one in zip(self.indices, by_term, strict=True):
            total[index] += one
        return total

    def local(self, r: int, point: Array) -> Array:
        """Return the coordinates (own + shared,) that recording `r` has of a `point` (d,)."""
        return point[self.indices[r]]

    def residuals(self, point: Array) -> list[Array]:
        """Return measured less corrected model of each recording at `point` (d,), weighted, (rows,)."""
        return self.for_each(
            lambda r: self.terms[r].objective.residual(self.local(r, point), self.terms[r].correction)
        )

    def reweighted(self, residuals: Sequence[Array], biased: Sequence[bool]) -> Self:
        """Return the objective with each recording and channel weighted by its residual.

        A residual that is `biased` has the model's bias in it (`MapObjective.reweighted`).
        """
        terms = tuple(
            term.reweighted(residual, biased=flag)
            for term, residual, flag in zip(self.terms, residuals, biased, strict=True)
        )
        return replace(self, terms=terms)

    def corrected(self, corrections: Sequence[Array]) -> Self:
        """Return the objective with these `corrections`, (rows,) of each recording."""
        terms = zip(self.terms, corrections, strict=True)
        return replace(self, terms=tuple(replace(term, correction=one) for term, one in terms))
