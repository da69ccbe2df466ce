"""A recording to be explained: what a model is driven with, and what it is compared to."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.recording import Recording, reconstructed, with_equivalent_current
from emaphm.simulation import (
    AVERAGED,
    OBSERVABLE,
    Initial,
    Inputs,
    Model,
    Plant,
    observe_batch,
    run,
    run_batch,
)
from emaphm.simulation.laws.angles import wrap


@dataclass(frozen=True, eq=False)
class Problem:
    """A recording, the actuator it was made on, and the model that is to reproduce it."""

    actuator: Actuator
    recording: Recording
    model: Model
    inputs: Inputs
    start: Initial
    workers: int | None = None
    channels: tuple[str, ...] = ("current_A",)
    """What is compared, of `OBSERVABLE`; the equivalent current first."""
    weights: Array = field(default_factory=lambda: np.ones(1))
    """What a residual of each channel counts, (channels,), in A of the current's residual."""
    warmer: float = 0.0
    """Recorded temperature above nominal [K], its mean."""

    @classmethod
    def of(
        cls,
        recording: Recording,
        actuator: Actuator,
        model: Model = AVERAGED,
        workers: int | None = None,
        channels: tuple[str, ...] = ("current_A",),
    ) -> Self:
        """Return the problem of explaining `recording` by `model` of `actuator`.

        The recorded command, and the load where it was recorded, drive the model, each as a smooth curve
        behind its rows.
        """
        load = reconstructed(recording, "load_Nm") if "load_Nm" in recording else 0.0
        recording = with_equivalent_current(recording, actuator)
        inputs = Inputs.of(
            reconstructed(recording, "command_rad"),
            load,
            samples=recording.samples,
            interval=recording.interval_s,
            step=model.step,
            sampling=recording.sampling,
        )
        warmer = 0.0
        if "temperature_K" in recording and actuator.electrical is not None:
            warmer = float(np.mean(recording["temperature_K"])) - actuator.electrical.temperature
        problem = cls(
            actuator, recording, model, inputs, initial(recording, actuator), workers, channels, warmer=warmer
        )
        # To begin with, a residual counts in proportion to its channel.
        return problem.weighted([float(np.sqrt(np.mean(problem.recording[name] ** 2))) for name in channels])

    def by(self, model: Model) -> Self:
        """Return the same problem for another model."""
        return type(self).of(self.recording, self.actuator, model, self.workers, self.channels)

    def weighted(self, sizes: ArrayLike) -> Self:
        """Return the problem with residuals weighted by the `sizes` (channels,) that they have."""
        deviations = np.maximum(np.asarray(sizes, float), np.finfo(float).tiny ** 0.5)
        return replace(self, weights=deviations[0] / deviations)

    @property
    def recorded(self) -> Array:
        """The recorded equivalent current [A], shape (samples,)."""
        return self.recording["current_A"]

    def currents(self, faults: ArrayLike, totals: Mapping[str, ArrayLike] | None = None) -> Array:
        """Return the model's currents [A] for faults (n, 8) and physical totals, shape (n, samples)."""
        plant = Plant.of(self.actuator, faults, totals)
        return run_batch(self.model, plant, self.inputs, self.start, workers=self.workers)

    @property
    def observed(self) -> Array:
        """The recorded channels, weighted and end to end, shape (channels × samples,)."""
        return np.concatenate(
            [weight * self.recording[name] for name, weight in zip(self.channels, self.weights, strict=True)]
        )

    def predict(self, faults: ArrayLike, totals: Mapping[str, ArrayLike] | None = None) -> Array:
        """Return what the model has for `observed`, shape (n, channels × samples)."""
        if self.channels == OBSERVABLE[:1]:
            return self.currents(faults, totals)
        plant = Plant.of(self.actuator, faults, totals)
        signals = observe_batch(
            self.model, plant, self.inputs, self.start, channels=self.channels, workers=self.workers
        )
        signals *= self.weights[:, np.newaxis]
        return signals.reshape(plant.count, -1)

    def signals(self, faults: ArrayLike, totals: Mapping[str, ArrayLike] | None = None) -> dict[str, Array]:
        """Return every channel of the model for one fault vector (8,), each of shape (samples,)."""
        signals = run(self.model, Plant.of(self.actuator, faults, totals), self.inputs, self.start)
        signals["angle_rad"] += self.start.rotor_offset
        return signals


def comparable(actuator: Actuator) -> tuple[str, ...]:
    """Return the channels that a model of `actuator` has to compare: no voltage without its windings."""
    return tuple(name for name in OBSERVABLE if name != "voltage_V" or actuator.electrical is not None)


def initial(recording: Recording, actuator: Actuator) -> Initial:
    """Return where the recorded manoeuvre starts.

    The user stands where it was recorded, or on the command where its position was not recorded or
    differs by no more than the sensor's noise; the gap is centred. Without a position the motor's angle
    stands in for it.
    """
    ratio = actuator.mechanics.gear_ratio
    # At the first instant: a row that is a mean stands for half an interval later.
    position = float(reconstructed(recording, "command_rad")(np.zeros(1))[0])
    if "position_rad" in recording:
        measured = recording["position_rad"]
        if abs(measured[0] - position) > 3 * noise_level(measured):
            position = float(measured[0])
    angle = position / ratio
    offset = _rotor_offset(recording, actuator) if "angle_rad" in recording else 0.0
    if "angle_rad" in recording and "position_rad" not in recording:
        angle += float(wrap(recording["angle_rad"][0] - offset - angle))
    return Initial(angle, _starting_speed(recording, ratio), offset)


def _rotor_offset(recording: Recording, actuator: Actuator) -> float:
    """Return the motor's angle less the user's [rad], 0 where backlash, noise or lag explain the distance."""
    ratio = actuator.mechanics.gear_ratio
    motor = np.unwrap(recording["angle_rad"])
    # The gap lets the motor be half its width ahead of the user, or behind.
    tolerance = actuator.mechanics.backlash * (1 + actuator.faults.backlash) / 2 + 3 * noise_level(motor)
    if "position_rad" in recording:
        user = recording["position_rad"] / ratio
        tolerance += 3 * noise_level(user)
    else:
        user = recording["command_rad"] / ratio
        tolerance += float(np.ptp(motor - user)) / 4
    distances = motor - user
    distance = float(wrap(distances[0] + np.median(wrap(distances - distances[0]))))
    return distance if abs(distance) > tolerance else 0.0


FIRST_ROWS = 10
"""Rows that the starting speed is taken from."""


def _starting_speed(recording: Recording, ratio: float) -> float:
    """Return the motor's speed [rad/s] at the first row, 0 where that is within three standard errors."""
    t = recording["time_s"][:FIRST_ROWS] - recording["time_s"][0]
    if "speed_rad_s" in recording:
        column, order, scale = recording["speed_rad_s"], 0, 1.0
    elif "position_rad" in recording:
        column, order, scale = recording["position_rad"], 1, 1 / ratio
    else:
        return 0.0
    coefficients, covariance = np.polyfit(t, column[:FIRST_ROWS], 2, cov=True)
    speed, error = coefficients[-1 - order], np.sqrt(covariance[-1 - order, -1 - order])
    return float(speed) * scale if abs(speed) > 3 * error else 0.0


def noise_level(values: Array) -> float:
    """Return the rms of the white noise on a smooth signal (n,), from its second differences."""
    return float(np.sqrt(np.mean(np.diff(values, 2) ** 2) / 6))
