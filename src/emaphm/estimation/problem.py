"""Estimation problem of one recording: the model, its input signals, and the channels it is compared with."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.estimation.driving_signals import DrivingSignals
from emaphm.estimation.rests import Rests
from emaphm.estimation.rows.unknown_start import FROM_REST, UnknownStart
from emaphm.estimation.run_counts import RunCounts
from emaphm.estimation.sensors.counts import ROUNDING, SharedErrors
from emaphm.estimation.sensors.sensor_model import all_as_described, as_described, described_noise
from emaphm.estimation.space.nuisances import NO_NUISANCES
from emaphm.recording.noise import measured_noise
from emaphm.recording.sensor_checks.resolution import Mask
from emaphm.simulation import Initial, Inputs, Model, Plant, observe_batch, run


@dataclass(frozen=True, eq=False)
class Problem:
    """An actuator, the model that is to reproduce its signals, and these signals.

    Attributes
    ----------
    driving, inputs
        Input signals of the model: as functions of time, and at its integration steps.
    start
        Initial state of the motion.
    measured
        The recorded signals by channel, each (samples,).
    channels
        Channels that are compared with the model. The first channel is primary: the equivalent current if it
        was recorded.
    weights
        Factor on each channel's residual, (channels,), which converts it to the unit of the primary channel.
    temperature_rise_K
        Recorded temperature of the windings above the nominal temperature; 0 if it was not recorded.
    unusable
        Rows that are not compared, (samples,) by channel.
    model_error
        The learned error of the model in each row, (samples,) by channel; empty if none was learned.
    counts
        Step of each channel with visible counts (of a converter or encoder), in its unit.
    shared_errors
        Rounding errors that successive rows of a channel share, for channels with such errors.
    band_spread
        Relative spread s of the hysteresis band between several runs of a hysteresis drive: the bands range
        from (1 - s) to (1 + s) times the described band.
    averaged_rows
        Number of rows of the recording that are averaged to one of `samples`.
    rests
        Rests of the shaft, and the random part of their means; None if unknown, or if there is no rest.
    unknown_start
        The time at the start that depends on an unknown motion before it: its rows are not compared.
    runs
        Counter of the simulations.
    """

    actuator: Actuator
    model: Model
    driving: DrivingSignals
    inputs: Inputs
    start: Initial
    measured: Mapping[str, Array]
    channels: tuple[str, ...] = ("current_A",)
    weights: Array = field(default_factory=lambda: np.ones(1))
    temperature_rise_K: float = 0.0
    workers: int | None = None
    runs: RunCounts = field(default_factory=RunCounts)
    unusable: Mapping[str, Mask] = field(default_factory=dict)
    model_error: Mapping[str, Array] = field(default_factory=dict)
    counts: Mapping[str, float] = field(default_factory=dict)
    shared_errors: Mapping[str, SharedErrors] = field(default_factory=dict)
    band_spread: float = 0.0
    averaged_rows: int = 1
    rests: Rests | None = None
    unknown_start: UnknownStart = FROM_REST

    def by(self, model: Model) -> Self:
        """Return the problem for another `model`, with the same start, weights and counts."""
        return replace(self, model=model, inputs=self.driving.inputs(model.step_for(self.actuator)))

    def starting_without(self, channel: str) -> Self:
        """Return the problem whose start does not depend on the zero of a position or speed `channel`.

        Without the position, the manoeuvre starts on the command; without the speed, it starts at rest.
        """
        if channel == "speed_rad_s":
            return replace(self, start=replace(self.start, speed=0.0))
        angle = float(self.driving.command(np.zeros(1))[0]) / self.actuator.mechanics.gear_ratio
        return replace(self, start=replace(self.start, angle=angle))

    def like(self, other: Self) -> Self:
        """Return the problem with the channels, the weights and the rests of `other`."""
        return replace(self, channels=other.channels, weights=other.weights, rests=other.rests)

    def weighted(self, sizes: ArrayLike) -> Self:
        """Return the problem with each channel weighted by the inverse size of its residual.

        `sizes` (channels,) are the rms of the residuals, each in the unit of its channel.
        """
        deviations = np.maximum(np.asarray(sizes, float), np.finfo(float).tiny ** 0.5)
        return replace(self, weights=deviations[0] / deviations)

    def observing(self, channels: tuple[str, ...]) -> Self:
        """Return the problem with other channels, each with weight 1."""
        return replace(self, channels=channels, weights=np.ones(len(channels)), rests=None)

    @property
    def samples(self) -> int:
        """Number of rows of a channel."""
        return self.inputs.samples

    @property
    def duration_s(self) -> float:
        """Duration of the recording [s]."""
        return self.inputs.samples * self.inputs.interval

    @property
    def primary(self) -> str:
        """The primary channel: a search without least squares uses it alone, and its residual is tested."""
        return self.channels[0]

    @property
    def recorded(self) -> Array:
        """The measured primary channel in its unit, shape (samples,)."""
        return self.measured[self.primary]

    @property
    def noise(self) -> float:
        """The rms of the white noise on the primary channel: described for its sensor, or else estimated."""
        described = described_noise(self.primary, self.actuator)
        if described is not None:
            return described
        return measured_noise(self.recorded, self.inputs.interval)

    def compared(self, channel: str, rows: Array) -> Array:
        """Return the compared part (compared,) of the `rows` (samples,) of a channel."""
        unusable = self.unusable.get(channel)
        return rows if unusable is None or unusable.all() else rows[~unusable]

    def compared_share(self, channel: str) -> float:
        """Return the share of a channel's rows that are compared; the residual of all other rows is 0."""
        return self.compared(channel, np.ones(self.samples)).size / self.samples

    @property
    def rounding_errors(self) -> Array:
        """The rms rounding error of each channel with visible counts, in its unit, (channels,)."""
        return np.array([self.counts.get(name, 0.0) for name in self.channels]) / ROUNDING

    @property
    def observed(self) -> Array:
        """The measured channels, weighted and concatenated, shape (channels × samples,)."""
        weighted = zip(self.channels, self.weights, strict=True)
        return np.concatenate([weight * self.measured[name] for name, weight in weighted])

    def predict_primary(self, faults: ArrayLike) -> Array:
        """Return the model's primary channel for faults (n, 8), shape (n, samples)."""
        return self._observe(faults, None, self.channels[:1])[:, 0]

    def predict(
        self,
        faults: ArrayLike,
        parameters: Mapping[str, ArrayLike] | None = None,
        channels: tuple[str, ...] = (),
    ) -> Array:
        """Return the model's outputs with the described sensors, unweighted, shape (n, channels, samples).

        The default `channels` are the compared channels.
        """
        return self._observe(faults, parameters, channels or self.channels)

    def exact(
        self, faults: ArrayLike, parameters: Mapping[str, ArrayLike] | None, channels: tuple[str, ...]
    ) -> Array:
        """Return the model's outputs without sensors, shape (n, channels, samples)."""
        plant = Plant.of(self.actuator, faults, parameters)
        if self.band_spread:
            factors = np.linspace(1 - self.band_spread, 1 + self.band_spread, plant.count)
            plant = replace(plant, hysteresis=plant.hysteresis * factors)
        self.runs.add(self.model, plant.count)
        return observe_batch(
            self.model, plant, self.inputs, self.start, channels=channels, workers=self.workers
        )

    def _observe(
        self, faults: ArrayLike, parameters: Mapping[str, ArrayLike] | None, channels: tuple[str, ...]
    ) -> Array:
        """Return the model's `channels` with the described sensors, shape (n, channels, samples)."""
        exact = self.exact(faults, parameters, channels)
        return all_as_described(exact, channels, self.actuator, self.inputs.interval)

    def signals(
        self, faults: ArrayLike, parameters: Mapping[str, ArrayLike] | None = None
    ) -> dict[str, Array]:
        """Return all channels of the model, with the described sensors, for one fault vector (8,).

        Each channel has the shape (samples,). The default lumped `parameters` are those of the description at
        the recorded temperature.
        """
        if parameters is None:
            parameters = NO_NUISANCES.lumped_parameters(self.actuator, {}, self.temperature_rise_K)
        signals = run(self.model, Plant.of(self.actuator, faults, parameters), self.inputs, self.start)
        self.runs.add(self.model, 1)
        signals["angle_rad"] += self.start.rotor_offset
        interval = self.inputs.interval
        return {name: as_described(signals[name], name, self.actuator, interval) for name in signals}
