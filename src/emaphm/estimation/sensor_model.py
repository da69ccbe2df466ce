"""What the sensors make of a model's signals: as the actuator describes them, and their unknown errors."""

from collections.abc import Mapping, Sequence

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.sensors import IDEAL
from emaphm.arrays import Array
from emaphm.simulation.laws.sensors import sensed, without_static_errors

SCALE_ERRORS = {"current_scale": "current_A"}
"""Nuisances that are a relative error of a channel's scale, by the channel that they act on."""

OFFSET_ERRORS = {"current_offset": "current_A"}
"""Nuisances that are an error of a channel's zero, in its unit, by the channel that they act on."""


def as_described(signal: Array, channel: str, actuator: Actuator, interval: float) -> Array:
    """Return a model's signal as the described sensor of its channel shows it, but for noise and rounding.

    Noise is random, and rounding has no derivatives: both belong to the residual (`described_noise`).

    Parameters
    ----------
    signal
        Of the channel, shape (…, samples), in its unit.
    interval
        Between rows [s].

    Raises
    ------
    MethodError
        The sensor's delay is as long as the recording.
    """
    return sensed(signal, actuator.sensors.of(channel), interval)


def all_as_described(signals: Array, channels: Sequence[str], actuator: Actuator, interval: float) -> Array:
    """Return a model's signals of the `channels`, (n, channels, samples), as their sensors show them."""
    if all(actuator.sensors.of(name) == IDEAL for name in channels):
        return signals
    shown = [as_described(signals[:, i], name, actuator, interval) for i, name in enumerate(channels)]
    return np.stack(shown, axis=1)


def true_values(values: Array, channel: str, actuator: Actuator) -> Array:
    """Return a recorded channel less the described errors of its scale and zero."""
    sensor = actuator.sensors.of(channel)
    return without_static_errors(values, sensor.scale, sensor.offset) if sensor != IDEAL else values


def described_noise(channel: str, actuator: Actuator) -> float | None:
    """Return the rms of noise and rounding that a channel's sensor is described with, None without."""
    return actuator.sensors.of(channel).noise_variance ** 0.5 or None


def with_unknown_errors(signals: Array, channels: Sequence[str], nuisances: Mapping[str, Array]) -> Array:
    """Return a model's signals with errors of the sensors that are being estimated: y = (1 + s) x + o.

    Parameters
    ----------
    signals
        Of the `channels`, shape (n, channels, samples), each in its unit; changed in place.
    nuisances
        Values (n,) by name; those without a sensor error here are left out.
    """
    for names, act in ((SCALE_ERRORS, _scale), (OFFSET_ERRORS, _shift)):
        for name, channel in names.items():
            if name in nuisances and channel in channels:
                act(signals[:, channels.index(channel)], nuisances[name][:, np.newaxis])
    return signals


def _scale(signal: Array, error: Array) -> None:
    signal *= 1 + error


def _shift(signal: Array, error: Array) -> None:
    signal += error
