"""The objective: points of a parameter space against the measured channels and against their priors.

Its minimum is the maximum a posteriori (MAP) estimate of normal residuals and normal priors.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from emaphm.arrays import Array, rms
from emaphm.estimation.problem import Problem
from emaphm.estimation.sensors.sensor_model import described_noise, sensor_error, with_unknown_errors
from emaphm.estimation.signal_size import signal_size
from emaphm.estimation.space.nuisances import NO_NUISANCES, NuisanceSet
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.estimation.space.parameter_variation import ParameterVariation
from emaphm.estimation.uncertainty.correlation import integral_time
from emaphm.recording.sensor_checks.resolution import Mask
from emaphm.simulation import Model

CORRELATED_ROWS = 20
"""Rows over which the residual of an uncorrected model is correlated, roughly: together they count as one
observation against a prior."""

LEAST_RESIDUAL = 1e-4
"""Least residual of a channel, relative to its size, that its weight is computed from."""

FIRST_RESIDUAL = 0.1
"""Residual of the primary channel assumed before the first search, relative to its rms."""


@dataclass(frozen=True, eq=False)
class MapObjective:
    """A problem, the space that its explanation is sought in, and the weight of the priors.

    A nuisance that is off by one standard deviation of its prior adds as much to the cost as
    `correlated_rows` rows of the primary channel with a residual of `residual_rms`, in its unit. The rows of
    `outputs` are the weighted channels end to end, then one row for each nuisance coordinate.
    """

    problem: Problem
    space: ParameterSpace
    residual_rms: float
    correlated_rows: float = CORRELATED_ROWS

    @classmethod
    def of(cls, problem: Problem, space: ParameterSpace) -> Self:
        """Return the objective of the first search, which assumes a residual of `FIRST_RESIDUAL`."""
        return cls(problem, space, 0.0).scale_prior(FIRST_RESIDUAL * rms(problem.recorded))

    def scale_prior(self, residual_rms: float) -> Self:
        """Return the objective whose priors are weighed against a primary residual of this rms [its unit]."""
        return replace(self, residual_rms=float(residual_rms))

    def reweighted(self, residual: Array, *, biased: bool = False) -> Self:
        """Return the objective with each channel weighted by the inverse rms of its `residual` (rows,).

        That maximises the likelihood of normal residuals whose variance by channel is not known beforehand.
        Against the priors, the rows over which the primary channel's residual is correlated count as one
        observation, `CORRELATED_ROWS` at most. While the model is not corrected, its residual `biased`, that
        number is `CORRELATED_ROWS`.
        """
        by_channel = residual[: self.channel_rows].reshape(len(self.problem.channels), -1)
        shares = [self.problem.compared_share(name) for name in self.problem.channels]
        sizes = np.sqrt(np.mean(by_channel**2, axis=1) / shares) / self.problem.weights
        # A perfect channel would leave the others without weight; no model is right to 0.01 %.
        measured = np.array(
            [signal_size(name, self.problem.measured[name]) for name in self.problem.channels]
        )
        # Nor is a residual less than what its sensor is described to add, or its counts leave open.
        noise = np.array(
            [described_noise(name, self.problem.actuator) or 0.0 for name in self.problem.channels]
        )
        noise = np.maximum(noise, self.problem.rounding_errors)
        sizes = np.maximum(sizes, np.maximum(LEAST_RESIDUAL * measured, noise))
        correlated = float(CORRELATED_ROWS)
        if not biased:
            correlated = min(integral_time([by_channel[0]], [1.0]), correlated)
        weighted = replace(self, problem=self.problem.weighted(sizes), correlated_rows=correlated)
        return weighted.scale_prior(sizes[0])

    def rescaled(self, rows: Array, other: Self) -> Array:
        """Return `rows` of `outputs` as this objective weights them, given as `other` does."""
        ratios = np.repeat(self.problem.weights / other.problem.weights, self.problem.samples)
        prior_ratios = np.full(len(self.space.nuisances.names), self.prior_weight / other.prior_weight)
        return np.asarray(rows * np.concatenate([ratios, prior_ratios]))

    @property
    def prior_weight(self) -> float:
        """The residual of a nuisance that is one prior deviation off, in the primary channel's unit."""
        return self.residual_rms * float(self.correlated_rows**0.5)

    @property
    def rows_of_priors(self) -> Array:
        """How many rows count as one observation against the prior of each coordinate, (d,)."""
        count = np.full(self.space.dimensions, float(CORRELATED_ROWS))
        count[len(self.space.columns) :] = self.correlated_rows
        return count

    @property
    def jacobian_of_priors(self) -> Array:
        """The derivatives of the rows that are priors by the coordinates, (d, nuisances)."""
        rows = np.zeros((self.space.dimensions, len(self.space.nuisances.names)))
        rows[len(self.space.columns) :] = np.diag(self.prior_weight / self.space.nuisances.priors)
        return rows

    @property
    def channel_rows(self) -> int:
        """Rows of `outputs` that are channels; the nuisances follow."""
        return len(self.problem.channels) * self.problem.samples

    @property
    def compared_rows(self) -> float:
        """Rows of channels that are compared: in the others no residual is counted."""
        problem = self.problem
        return problem.samples * sum(problem.compared_share(name) for name in problem.channels)

    def mean_square(self, residual: Array) -> float:
        """Return the mean square of a weighted `residual` (rows,) plus that of the rounding to counts.

        The ratio of two residuals means nothing below the rounding: where a model happens to give the same
        counts as were recorded, its residual is 0, and the variance of a row is not.
        """
        open_by_counts = np.mean((self.problem.weights * self.problem.rounding_errors) ** 2)
        return float(np.mean(residual**2)) + float(open_by_counts)

    @property
    def target(self) -> Array:
        """What `outputs` should be: the measured channels, weighted, and 0 for each nuisance, (rows,)."""
        return np.concatenate([self.problem.observed, np.zeros(len(self.space.nuisances.names))])

    def of_channels(self, rows: Array) -> Array:
        """Return the channels' part of `rows`, which comes first, with 0 for each nuisance, (rows,)."""
        known = np.zeros(self.channel_rows + len(self.space.nuisances.names))
        known[: self.channel_rows] = rows[: self.channel_rows]
        return known

    def outputs(self, points: Array) -> Array:
        """Return the channels as sensed and weighted, then the nuisances, at `points` (n, d): (n, rows)."""
        sensed = self._sensed(points, self.problem.channels)
        if self.problem.rests is not None:
            self.problem.rests.draw(
                sensed, np.stack([self.problem.measured[name] for name in self.problem.channels])
            )
        rows: Array = np.empty((len(points), self.channel_rows + len(self.space.nuisances.names)))
        channels = rows[:, : self.channel_rows].reshape(sensed.shape)
        np.multiply(sensed, self.problem.weights[:, np.newaxis], out=channels)
        coordinates = points[:, len(self.space.columns) :]
        rows[:, self.channel_rows :] = self.prior_weight * coordinates / self.space.nuisances.priors
        return rows

    def residual(self, point: Array, correction: Array | float = 0.0) -> Array:
        """Return the target less the outputs at `point` (d,) and less a `correction` of them, (rows,)."""
        return np.asarray(self.target - self.outputs(point[np.newaxis])[0] - correction)

    def primary_outputs(self, points: Array) -> Array:
        """Return the model's primary channel at `points` (n, d), as sensed, shape (n, samples)."""
        return self._sensed(points, (self.problem.primary,))[:, 0]

    def _sensed(self, points: Array, channels: tuple[str, ...]) -> Array:
        """Return the model's `channels` at `points` (n, d) as sensed, shape (n, channels, samples).

        Points that differ in errors of the sensors alone share one run of the model.
        """
        acting = [
            i
            for i, name in enumerate(self.space.coordinates)
            if i < len(self.space.columns) or sensor_error(name) is None
        ]
        alike = np.arange(len(points))
        chosen = points
        if len(acting) < points.shape[1] and len(points) > 1:
            _, first, alike = np.unique(points[:, acting], axis=0, return_index=True, return_inverse=True)
            chosen, alike = points[first], alike.reshape(-1)
        simulated = self.problem.predict(
            self.space.faults(chosen), self.lumped_parameters(chosen), channels=channels
        )
        signals = simulated if chosen is points else simulated[alike]
        nuisances = self.space.nuisance_values(points)
        problem = self.problem
        shown = with_unknown_errors(signals, channels, nuisances, problem.measured, problem.inputs.interval)
        for i, name in enumerate(channels):
            if name in problem.unusable:
                # Rows that leave no residual, whatever the point, say nothing.
                np.copyto(shown[:, i], problem.measured[name], where=problem.unusable[name])
        return shown

    def lumped_parameters(self, points: Array) -> dict[str, Array]:
        """Return the lumped parameters at `points` (n, d) that are not the description's."""
        values = self.space.nuisance_values(points)
        return self.space.nuisances.lumped_parameters(
            self.problem.actuator, values, self.problem.temperature_rise_K
        )

    def ignoring(self, unusable: Mapping[str, Mask]) -> Self:
        """Return the objective that also leaves out the `unusable` rows, (samples,) by channel."""
        before = self.problem.unusable
        both = {name: before.get(name, False) | rows for name, rows in unusable.items()}
        return replace(self, problem=replace(self.problem, unusable={**before, **both})) if both else self

    def by(self, model: Model) -> Self:
        """Return the same objective of another model."""
        return replace(self, problem=self.problem.by(model))


def faults_objective(
    problem: Problem, nuisances: Sequence[str] | None, *, below_healthy: bool = True
) -> MapObjective:
    """Return the objective of finding the faults and the `nuisances` of a problem.

    `nuisances` are named, or the actuator's own where None; those that a measured channel makes known are
    left out. What the actuator's baseline leaves open is estimated with them. `below_healthy` as in
    `ParameterSpace.of`.

    Raises
    ------
    MethodError
        A nuisance is unknown, or needs the electrical description that the actuator lacks.
    """
    measured, duration = tuple(problem.measured), problem.inputs.duration
    chosen = NuisanceSet.of(problem.actuator, nuisances, measured, duration=duration)
    space = ParameterSpace.of(problem.actuator, chosen, below_healthy=below_healthy)
    return MapObjective.of(problem, space)


def faults_only_objective(problem: Problem) -> MapObjective:
    """Return the objective of finding the faults alone, as a population method without least squares does.

    They are in [0, 1], as in the thesis: no friction is below healthy.
    """
    return MapObjective.of(problem, ParameterSpace.of(problem.actuator, NO_NUISANCES, below_healthy=False))


def healthy_objective(
    problem: Problem, nuisances: Sequence[str] | None, unit: ParameterVariation
) -> MapObjective:
    """Return the objective of finding a healthy unit's parameters, and the `nuisances`.

    Errors as in `faults_objective`.
    """
    measured, duration = tuple(problem.measured), problem.inputs.duration
    chosen = NuisanceSet.of(problem.actuator, nuisances, measured, unit, duration=duration)
    return MapObjective.of(problem, ParameterSpace.healthy(chosen))
