"""Objective function of the estimation: weighted residuals of the measured channels, and the priors.

Its minimum is the maximum a posteriori (MAP) estimate for normal residuals and normal priors.
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

CORRELATED_ROWS = 20
"""Approximate number of rows over which the residual of an uncorrected model is correlated: together they
count as one observation against a prior."""

LEAST_RESIDUAL = 1e-4
"""Lower limit of a channel's residual in the computation of its weight, relative to the channel's size."""

FIRST_RESIDUAL = 0.1
"""Residual of the primary channel assumed before the first search, relative to its rms."""


@dataclass(frozen=True, eq=False)
class MapObjective:
    """A problem, the parameter space that is searched, and the weight of the priors.

    A nuisance that deviates by one standard deviation of its prior adds as much to the cost as
    `correlated_rows` rows of the primary channel with a residual of `residual_rms`, in its unit. The rows of
    `outputs` are the concatenated weighted channels, then one row for each nuisance coordinate.
    """

    problem: Problem
    space: ParameterSpace
    residual_rms: float
    correlated_rows: float = CORRELATED_ROWS

    @classmethod
    def of(cls, problem: Problem, space: ParameterSpace) -> Self:
        """Return the objective of the first search, which assumes a relative residual `FIRST_RESIDUAL`."""
        return cls(problem, space, 0.0).scale_prior(FIRST_RESIDUAL * rms(problem.recorded))

    def scale_prior(self, residual_rms: float) -> Self:
        """Return the objective with priors weighed against a primary residual of this rms, in its unit."""
        return replace(self, residual_rms=float(residual_rms))

    def reweighted(self, residual: Array, *, biased: bool = False) -> Self:
        """Return the objective with each channel weighted by the inverse rms of its `residual` (rows,).

        These weights maximise the likelihood of normal residuals whose variances by channel are unknown.
        Against the priors, the rows over which the primary channel's residual is correlated count as one
        observation, `CORRELATED_ROWS` rows at most. As long as the residual is `biased` because the model is
        not corrected, the number of rows is `CORRELATED_ROWS`.
        """
        by_channel = residual[: self.channel_rows].reshape(len(self.problem.channels), -1)
        shares = [self.problem.compared_share(name) for name in self.problem.channels]
        sizes = np.sqrt(np.mean(by_channel**2, axis=1) / shares) / self.problem.weights
        # A residual of 0 would reduce the weights of all other channels to 0; no model is exact to 0.01 %.
        measured = np.array(
            [signal_size(name, self.problem.measured[name]) for name in self.problem.channels]
        )
        # No true residual is smaller than the described noise of the sensor, or the rounding error.
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
        """Return `rows` of `outputs`, which have the weights of `other`, with this objective's weights."""
        ratios = np.repeat(self.problem.weights / other.problem.weights, self.problem.samples)
        prior_ratios = np.full(len(self.space.nuisances.names), self.prior_weight / other.prior_weight)
        return np.asarray(rows * np.concatenate([ratios, prior_ratios]))

    @property
    def prior_weight(self) -> float:
        """The residual of a nuisance that deviates by one prior standard deviation, in the primary's unit."""
        return self.residual_rms * float(self.correlated_rows**0.5)

    @property
    def rows_of_priors(self) -> Array:
        """The number of rows that count as one observation against the prior of each coordinate, (d,)."""
        count = np.full(self.space.dimensions, float(CORRELATED_ROWS))
        count[len(self.space.columns) :] = self.correlated_rows
        return count

    @property
    def jacobian_of_priors(self) -> Array:
        """The derivatives of the rows of the priors by the coordinates, (d, nuisances)."""
        rows = np.zeros((self.space.dimensions, len(self.space.nuisances.names)))
        rows[len(self.space.columns) :] = np.diag(self.prior_weight / self.space.nuisances.priors)
        return rows

    @property
    def channel_rows(self) -> int:
        """Number of rows of `outputs` that are channels; the rows of the nuisances follow."""
        return len(self.problem.channels) * self.problem.samples

    @property
    def compared_rows(self) -> float:
        """Number of compared rows of all channels; the residual of all other rows is 0."""
        problem = self.problem
        return problem.samples * sum(problem.compared_share(name) for name in problem.channels)

    def mean_square(self, residual: Array) -> float:
        """Return the mean square of a weighted `residual` (rows,) plus that of the rounding errors.

        Below the rounding error, a ratio of two residuals has no meaning: a model that happens to give the
        recorded counts has a residual of 0, although the variance of a row is not 0.
        """
        rounding_variance = np.mean((self.problem.weights * self.problem.rounding_errors) ** 2)
        return float(np.mean(residual**2)) + float(rounding_variance)

    @property
    def target(self) -> Array:
        """Target of `outputs`: the weighted measured channels, and 0 for each nuisance, (rows,)."""
        return np.concatenate([self.problem.observed, np.zeros(len(self.space.nuisances.names))])

    def of_channels(self, rows: Array) -> Array:
        """Return `rows` with the rows of the nuisances, which follow the channels, set to 0, (rows,)."""
        channels = np.zeros(self.channel_rows + len(self.space.nuisances.names))
        channels[: self.channel_rows] = rows[: self.channel_rows]
        return channels

    def outputs(self, points: Array) -> Array:
        """Return the sensed and weighted channels, then the nuisances, at `points` (n, d): (n, rows)."""
        problem = self.problem
        sensed = self._sensed(points, problem.channels)
        if problem.rests is not None:
            problem.rests.draw(sensed, np.stack([problem.measured[name] for name in problem.channels]))
            self._leave_out(sensed, problem.channels)
        rows: Array = np.empty((len(points), self.channel_rows + len(self.space.nuisances.names)))
        channels = rows[:, : self.channel_rows].reshape(sensed.shape)
        np.multiply(sensed, problem.weights[:, np.newaxis], out=channels)
        coordinates = points[:, len(self.space.columns) :]
        rows[:, self.channel_rows :] = self.prior_weight * coordinates / self.space.nuisances.priors
        return rows

    def residual(self, point: Array, correction: Array | float = 0.0) -> Array:
        """Return target - outputs - correction at `point` (d,), (rows,)."""
        return np.asarray(self.target - self.outputs(point[np.newaxis])[0] - correction)

    def primary_outputs(self, points: Array) -> Array:
        """Return the sensed primary channel of the model at `points` (n, d), shape (n, samples)."""
        return self._sensed(points, (self.problem.primary,))[:, 0]

    def _sensed(self, points: Array, channels: tuple[str, ...]) -> Array:
        """Return the sensed `channels` of the model at `points` (n, d), shape (n, channels, samples).

        Points that differ only in errors of the sensors share one run of the model.
        """
        simulated_coordinates = [
            i
            for i, name in enumerate(self.space.coordinates)
            if i < len(self.space.columns) or sensor_error(name) is None
        ]
        run_of_point = np.arange(len(points))
        distinct = points
        if len(simulated_coordinates) < points.shape[1] and len(points) > 1:
            _, first, run_of_point = np.unique(
                points[:, simulated_coordinates], axis=0, return_index=True, return_inverse=True
            )
            distinct, run_of_point = points[first], run_of_point.reshape(-1)
        simulated = self.problem.predict(
            self.space.faults(distinct), self.lumped_parameters(distinct), channels=channels
        )
        signals = simulated if distinct is points else simulated[run_of_point]
        nuisances = self.space.nuisance_values(points)
        problem = self.problem
        sensed = with_unknown_errors(signals, channels, nuisances, problem.measured, problem.inputs.interval)
        self._leave_out(sensed, channels)
        return sensed

    def _leave_out(self, sensed: Array, channels: tuple[str, ...]) -> None:
        """Replace rows of `sensed` (n, channels, samples) that are not compared by the measured, in place.

        Rows whose residual is 0 at every point carry no information.
        """
        for i, name in enumerate(channels):
            if name in self.problem.unusable:
                np.copyto(sensed[:, i], self.problem.measured[name], where=self.problem.unusable[name])

    def lumped_parameters(self, points: Array) -> dict[str, Array]:
        """Return the lumped parameters at `points` (n, d) that differ from the description."""
        values = self.space.nuisance_values(points)
        return self.space.nuisances.lumped_parameters(
            self.problem.actuator, values, self.problem.temperature_rise_K
        )

    def ignoring(self, unusable: Mapping[str, Mask]) -> Self:
        """Return the objective without the `unusable` rows, (samples,) by channel, either."""
        before = self.problem.unusable
        merged = {name: before.get(name, False) | rows for name, rows in unusable.items()}
        return replace(self, problem=replace(self.problem, unusable={**before, **merged})) if merged else self


def faults_objective(
    problem: Problem, nuisances: Sequence[str] | None, *, below_healthy: bool = True
) -> MapObjective:
    """Return the objective of an estimation of the faults and the `nuisances` of a problem.

    `nuisances` are names; None stands for the nuisances of the actuator's description. Nuisances that a
    measured channel determines are left out. Parameters that are uncertain in the actuator's baseline are
    also estimated. `below_healthy` as in `ParameterSpace.of`.

    Raises
    ------
    MethodError
        A nuisance is unknown, or needs an electrical description, which the actuator does not have.
    """
    measured, duration = tuple(problem.measured), problem.inputs.duration
    chosen = NuisanceSet.of(problem.actuator, nuisances, measured, duration=duration)
    space = ParameterSpace.of(problem.actuator, chosen, below_healthy=below_healthy)
    return MapObjective.of(problem, space)


def faults_only_objective(problem: Problem) -> MapObjective:
    """Return the objective of an estimation of the faults alone, for population methods.

    The faults are in [0, 1], as in the thesis: friction is not below healthy.
    """
    return MapObjective.of(problem, ParameterSpace.of(problem.actuator, NO_NUISANCES, below_healthy=False))


def healthy_objective(
    problem: Problem, nuisances: Sequence[str] | None, unit: ParameterVariation
) -> MapObjective:
    """Return the objective of an estimation of a healthy unit's parameters and the `nuisances`.

    Raises errors as `faults_objective` does.
    """
    measured, duration = tuple(problem.measured), problem.inputs.duration
    chosen = NuisanceSet.of(problem.actuator, nuisances, measured, unit, duration=duration)
    return MapObjective.of(problem, ParameterSpace.healthy(chosen))
