"""A recording to be reproduced: what a model is driven with, and what its outputs are compared with."""

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
        What drives the model: as functions of time, and at its integration steps.
    start
        Where the motion begins.
    measured
        The recorded signals by channel, each (samples,).
    channels
        Those that are compared with the model. The first one is primary: the equivalent current where there
        is one.
    weights
        Factor on each channel's residual, (channels,), which brings it to the unit of the primary one's.
    temperature_rise_K
        Of the windings above the nominal temperature, as recorded; 0 where it was not.
    unusable
        Rows that are not compared, (samples,) by channel.
    model_error
        The learned error of the model in each row, (samples,) by channel; empty where none was learned.
    counts
        Step of each channel whose values visibly come in steps (of a converter or encoder), in its unit.
    shared_errors
        Rounding errors that successive rows of a channel share; of those that have any.
    band_spread
        Several runs of a hysteresis drive have bands from (1 - this) to (1 + this) times the described one.
    averaged_rows
        How many rows of the recording each of `samples` is the mean of.
    rests
        Where the shaft stands, and what of the rows there is chance; None where it is not known, or nowhere.
    unknown_start
        The time at the start that depends on an unknown motion before it: its rows are not compared.
    runs
        Counts the simulations.
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
        """Return the same problem for another model: start, weights and counts are the same."""
        return replace(self, model=model, inputs=self.driving.inputs(model.step_for(self.actuator)))

    def starting_without(self, channel: str) -> Self:
        """Return the problem whose start does not depend on the zero of a `channel`, position or speed.

        Without a position the manoeuvre starts on the command, without a speed at rest.
        """
        if channel == "speed_rad_s":
            return replace(self, start=replace(self.start, speed=0.0))
        angle = float(self.driving.command(np.zeros(1))[0]) / self.actuator.mechanics.gear_ratio
        return replace(self, start=replace(self.start, angle=angle))

    def like(self, other: Self) -> Self:
        """Return the problem with the channels, the weights and the rests of `other`."""
        return replace(self, channels=other.channels, weights=other.weights, rests=other.rests)

    def weighted(self, sizes: ArrayLike) -> Self:
        """Return the problem with channels weighted by the inverse `sizes` (channels,) of their residuals."""
        deviations = np.maximum(np.asarray(sizes, float), np.finfo(float).tiny ** 0.5)
        return replace(self, weights=deviations[0] / deviations)

    def observing(self, channels: tuple[str, ...]) -> Self:
        """Return the problem with other channels, each with weight 1."""
        return replace(self, channels=channels, weights=np.ones(len(channels)), rests=None)

    @property
    def samples(self) -> int:
        """Rows of a channel."""
        return self.inputs.samples

    @property
    def duration_s(self) -> float:
        """Time covered [s]."""
        return self.inputs.samples * self.inputs.interval

    @property
    def primary(self) -> str:
        """The channel that a search without least squares compares, and whose residual is judged."""
        return self.channels[0]

    @property
    def recorded(self) -> Array:
        """The measured primary channel, in its unit, shape (samples,)."""
        return self.measured[self.primary]

    @property
    def noise(self) -> float:
        """The rms of the white noise on the primary channel: as its sensor is described, else as measured."""
        described = described_noise(self.primary, self.actuator)
        if described is not None:
            return described
        return measured_noise(self.recorded, self.inputs.interval)

    def compared(self, channel: str, rows: Array) -> Array:
        """Return those of the `rows` (samples,) of a channel that are compared, (compared,)."""
        unusable = self.unusable.get(channel)
        return rows if unusable is None or unusable.all() else rows[~unusable]

    def compared_share(self, channel: str) -> float:
        """Return the share of a channel's rows that are compared: in the others no residual is counted."""
        return self.compared(channel, np.ones(self.samples)).size / self.samples

    @property
    def rounding_errors(self) -> Array:
        """The rms that rounding to visible counts leaves of each channel, in its unit, (channels,)."""
        return np.array([self.counts.get(name, 0.0) for name in self.channels]) / ROUNDING

    @property
    def observed(self) -> Array:
        """The measured channels, weighted and end to end, shape (channels × samples,)."""
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
        """Return what the sensors show of the model, unweighted, shape (n, channels, samples).

        `channels` are those that are compared where left out.
        """
        return self._observe(faults, parameters, channels or self.channels)

    def exact(
        self, faults: ArrayLike, parameters: Mapping[str, ArrayLike] | None, channels: tuple[str, ...]
    ) -> Array:
        """Return what the model has, without any sensor, shape (n, channels, samples)."""
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
        exact = self.exact(faults, parameters, channels)
        return all_as_described(exact, channels, self.actuator, self.inputs.interval)

    def signals(
        self, faults: ArrayLike, parameters: Mapping[str, ArrayLike] | None = None
    ) -> dict[str, Array]:
        """Return every channel of the model for one fault vector (8,) as sensed, each of shape (samples,).

        Lumped `parameters` are those of the description at the known temperature where they are left out.
        """
        if parameters is None:
            parameters = NO_NUISANCES.lumped_parameters(self.actuator, {}, self.temperature_rise_K)
        signals = run(self.model, Plant.of(self.actuator, faults, parameters), self.inputs, self.start)
        self.runs.add(self.model, 1)
        signals["angle_rad"] += self.start.rotor_offset
        interval = self.inputs.interval
        return {name: as_described(signals[name], name, self.actuator, interval) for name in signals}
