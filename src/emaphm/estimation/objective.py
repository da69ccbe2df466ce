"""What is fitted to what: points of a space to the recorded channels and to what is known before."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.parameter_space import FaultSpace
from emaphm.estimation.problem import Problem

CORRELATED_ROWS = 20
"""Rows over which a residual is correlated, roughly: so many count as one against a prior."""

LEAST_MOTION = 0.01
"""Share of the command's range that the position covers at least where a manoeuvre moves the actuator."""

FINEST = 1e-4
"""Least residual, as a share of its channel, that a channel is trusted to."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A problem and the space that its explanation is sought in.

    `tolerance` [A] is the residual that a nuisance one prior standard deviation off is worth.
    """

    problem: Problem
    space: FaultSpace
    tolerance: float

    @classmethod
    def of(cls, problem: Problem, space: FaultSpace) -> Self:
        """Return the fit to begin with, its residual put at a tenth of the current."""
        return cls(problem, space, 0.0).against(np.sqrt(np.mean(problem.recorded**2)) / 10)

    def against(self, residual_rms: float) -> Self:
        """Return the fit with priors that hold their own against a residual of that rms [A]."""
        return replace(self, tolerance=float(residual_rms) * CORRELATED_ROWS**0.5)

    def reweighted(self, residual: Array) -> Self:
        """Return the fit with each channel, and the priors, weighted by what `residual` (rows,) it leaves.

        Of several channels the one that is known best counts most: the likelihood of normal residuals
        whose size is not known beforehand.
        """
        samples, count = self.problem.recording.samples, len(self.problem.channels)
        by_channel = residual[: self.recorded_rows].reshape(count, samples)
        sizes = np.sqrt(np.mean(by_channel**2, axis=1)) / self.problem.weights
        # A perfect channel would silence the others; nothing is right to a hundredth of a percent.
        recorded = [np.sqrt(np.mean(self.problem.recording[name] ** 2)) for name in self.problem.channels]
        sizes = np.maximum(sizes, FINEST * np.array(recorded))
        return replace(self, problem=self.problem.weighted(sizes)).against(sizes[0])

    def rescaled(self, rows: Array, other: Self) -> Array:
        """Return `rows` of `outputs` as this fit weights them, given as `other` does."""
        samples, m = self.problem.recording.samples, len(self.space.nuisances.names)
        ratios = np.repeat(self.problem.weights / other.problem.weights, samples)
        return np.asarray(rows * np.concatenate([ratios, np.full(m, self.tolerance / other.tolerance)]))

    @property
    def recorded_rows(self) -> int:
        """Rows of `outputs` that are recorded; the nuisances follow."""
        return len(self.problem.channels) * self.problem.recording.samples

    @property
    def target(self) -> Array:
        """What `outputs` should be: the recorded channels, weighted, and 0 for each nuisance."""
        return np.concatenate([self.problem.observed, np.zeros(len(self.space.nuisances.names))])

    def outputs(self, points: Array) -> Array:
        """Return the model's channels, weighted, and the nuisances at `points` (n, d), shape (n, rows)."""
        return self._rows(self.problem.predict(self.space.faults(points), self.totals(points)), points)

    def currents(self, points: Array) -> Array:
        """Return the model's equivalent current at `points` (n, d), as sensed [A], shape (n, samples)."""
        return self._sensed(self.problem.currents(self.space.faults(points), self.totals(points)), points)

    def totals(self, points: Array) -> dict[str, Array]:
        """Return the physical totals at `points` (n, d) that are not the description's."""
        space = self.space
        values = space.nuisance_values(points)
        return space.nuisances.totals(self.problem.actuator, values, self.problem.warmer)

    def by(self, other: Problem) -> Self:
        """Return the same fit of another model's problem, weighted alike."""
        return replace(self, problem=replace(other, weights=self.problem.weights))

    def _rows(self, predicted: Array, points: Array) -> Array:
        """Return the weighted channels (n, recorded rows) as sensed, followed by the nuisances."""
        sensed = self._sensed(predicted, points)
        priors = self.tolerance * points[:, len(self.space.columns) :] / self.space.nuisances.priors
        return np.concatenate([sensed, priors], axis=1) if priors.size else sensed

    def _sensed(self, predicted: Array, points: Array) -> Array:
        """Return outputs (n, rows), whose first channel is the current, as the sensor shows them."""
        values = self.space.nuisance_values(points)
        samples = self.problem.recording.samples
        if "current_scale" in values:
            predicted[:, :samples] *= 1 + values["current_scale"][:, np.newaxis]
        if "current_offset" in values:
            predicted[:, :samples] += values["current_offset"][:, np.newaxis]
        return predicted
