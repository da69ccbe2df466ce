"""What the sensors make of a model's signals: as the actuator describes them, and their unknown errors."""

from collections.abc import Mapping, Sequence

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.sensors import IDEAL
from emaphm.arrays import Array
from emaphm.simulation.laws.sensors import delayed, sensed, without_static_errors

SENSOR_CHANNELS = {
    "current": ("current_A", "current_q_A"),
    "voltage": ("voltage_V", "voltage_q_V"),
    "position": ("position_rad",),
    "speed": ("speed_rad_s",),
}
"""The channels whose sensors may have unknown errors, by the quantity that they measure."""

ERROR_KINDS = ("scale", "offset", "drift", "delay")
"""Errors of one sensor; a nuisance is named after quantity and kind, such as `voltage_scale`."""

COMMON_DELAY = "delay"
"""The nuisance that all sensed channels are late by, against the command."""


def as_described(signal: Array, channel: str, actuator: Actuator, interval: float) -> Array:
    """Return a model's signal as the described sensor of its channel shows it, but for noise and rounding.

    Noise is random, and rounding has no derivatives: both belong to the residual (`described_noise`), and
    where a recording shows counts, these to the discrepancy of the models (`counts`).

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
    """Return `values` (samples,) of a recorded channel less the described errors of its scale and zero."""
    sensor = actuator.sensors.of(channel)
    return without_static_errors(values, sensor.scale, sensor.offset) if sensor != IDEAL else values


def described_noise(channel: str, actuator: Actuator) -> float | None:
    """Return the rms of noise and rounding that a channel's sensor is described with, None without."""
    return actuator.sensors.of(channel).noise_variance ** 0.5 or None


def sensor_of(channel: str) -> str | None:
    """Return the quantity that a channel's sensor measures, None where no unknown errors are known of it."""
    return next((quantity for quantity, channels in SENSOR_CHANNELS.items() if channel in channels), None)


def sensor_error(name: str) -> tuple[str, str] | None:
    """Return the quantity and the kind of the error that nuisance `name` is, None for any other nuisance.

    The quantity of the delay that all channels have in common is "all".
    """
    if name == COMMON_DELAY:
        return "all", "delay"
    quantity, _, kind = name.rpartition("_")
    return (quantity, kind) if quantity in SENSOR_CHANNELS and kind in ERROR_KINDS else None


def error_kind(name: str) -> str:
    """Return the kind of the sensor's error that nuisance `name` is, nothing for any other nuisance."""
    return (sensor_error(name) or ("", ""))[1]


def with_unknown_errors(
    signals: Array,
    channels: Sequence[str],
    nuisances: Mapping[str, Array],
    measured: Mapping[str, Array],
    interval: float,
) -> Array:
    """Return a model's signals with errors of the sensors that are being estimated.

        y(t) = (1 + s) x(t - d) + o + r t / T

    with T the duration, r the drift over it. Rows that an early channel takes from beyond the end are as
    measured: the model says nothing of them.

    Parameters
    ----------
    signals
        x of the `channels`, shape (n, channels, samples), each in its unit; changed in place.
    nuisances
        Values (n,) by name: s relative, o and r in the channel's unit, d in s; those without a sensor error
        are left out.
    measured
        Signals (samples,) by channel; one that was not measured keeps its last value beyond the end.
    interval
        Between rows [s].
    """
    if not any(sensor_error(name) for name in nuisances):
        return signals
    rows = signals.shape[-1]
    time = np.linspace(0.0, 1.0, rows)
    for i, channel in enumerate(channels):
        quantity = sensor_of(channel)
        if quantity is None:
            continue
        signal = signals[:, i]
        delays = [nuisances[name] for name in (COMMON_DELAY, f"{quantity}_delay") if name in nuisances]
        delay = np.sum(delays, axis=0) if delays else np.zeros(len(signal))
        if delays:
            signal[:] = shifted(signal, interval, delay)
        if (name := f"{quantity}_scale") in nuisances:
            signal *= 1 + nuisances[name][:, np.newaxis]
        if (name := f"{quantity}_offset") in nuisances:
            signal += nuisances[name][:, np.newaxis]
        if (name := f"{quantity}_drift") in nuisances:
            signal += nuisances[name][:, np.newaxis] * time
        if channel in measured and np.any(delay < 0):
            beyond = np.arange(rows) > rows - 2 + delay[:, np.newaxis] / interval
            np.copyto(signal, measured[channel], where=beyond & (delay < 0)[:, np.newaxis])
    return signals


def shifted(signal: Array, interval: float, delay: Array) -> Array:
    """Return a signal (n, samples) later by `delay` (n,) [s], of either sign.

    Cubic between the rows; at rest before the first one, and beyond the one that would follow the last.
    """
    rows = signal.shape[-1]
    ahead = int(np.ceil(max(-float(np.min(delay)), 0.0) / interval))
    # What follows the last row is the same whatever the other delays are: a parabola's next, then at rest.
    after = 3 * (signal[:, -1:] - signal[:, -2:-1]) + signal[:, -3:-2]
    longer = np.concatenate([signal, np.repeat(after, ahead + 1, axis=1)], axis=1)
    return delayed(longer, interval, delay + ahead * interval)[:, ahead : ahead + rows]
