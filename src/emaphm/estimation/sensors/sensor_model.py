"""Sensor models: described sensors and unknown sensor errors, applied to a model's signals."""

from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.sensors import IDEAL, Sensors
from emaphm.arrays import Array
from emaphm.identity_cache import cached_by_identity
from emaphm.simulation.laws.sensors import delayed, sensed, without_static_errors

SENSOR_CHANNELS = {
    "current": ("current_A", "current_q_A"),
    "voltage": ("voltage_V", "voltage_q_V"),
    "position": ("position_rad",),
    "speed": ("speed_rad_s",),
}
"""The channels whose sensors may have unknown errors, by measured quantity."""

ERROR_KINDS = ("scale", "offset", "drift", "delay")
"""Errors of a sensor; the name of a nuisance consists of quantity and kind, for example `voltage_scale`."""

COMMON_DELAY = "delay"
"""The nuisance of a common delay of all sensed channels relative to the command."""


def as_described(signal: Array, channel: str, actuator: Actuator, interval: float) -> Array:
    """Return a model's signal after the described sensor of its channel, without noise and rounding.

    Noise is random, and rounding has no derivatives: both are part of the residual (`described_noise`). For
    channels with visible counts, rounding is part of the discrepancy of the models (`counts`).

    Parameters
    ----------
    signal
        Signal of the channel, shape (…, samples), in its unit.
    interval
        Time between rows [s].

    Raises
    ------
    MethodError
        The sensor's delay is as long as the recording.
    """
    return sensed(signal, actuator.sensors.of(channel), interval)


def all_as_described(signals: Array, channels: Sequence[str], actuator: Actuator, interval: float) -> Array:
    """Return a model's signals of the `channels`, (n, channels, samples), after their described sensors."""
    if _sensors_are_ideal(actuator):
        return signals
    described = [as_described(signals[:, i], name, actuator, interval) for i, name in enumerate(channels)]
    return np.stack(described, axis=1)


@cached_by_identity
def _sensors_are_ideal(actuator: Actuator) -> bool:
    return actuator.sensors == Sensors()


def true_values(values: Array, channel: str, actuator: Actuator) -> Array:
    """Return `values` (samples,) of a recorded channel without the described errors of its scale and zero."""
    sensor = actuator.sensors.of(channel)
    return without_static_errors(values, sensor.scale, sensor.offset) if sensor != IDEAL else values


def described_noise(channel: str, actuator: Actuator) -> float | None:
    """Return the described rms of noise and rounding of a channel's sensor, None if none is described."""
    return actuator.sensors.of(channel).noise_variance ** 0.5 or None


def sensor_of(channel: str) -> str | None:
    """Return the quantity that a channel's sensor measures, None if it cannot have unknown errors."""
    return next((quantity for quantity, channels in SENSOR_CHANNELS.items() if channel in channels), None)


@cache
def sensor_error(name: str) -> tuple[str, str] | None:
    """Return quantity and kind of the sensor error of nuisance `name`, None if it is not a sensor error.

    The quantity of the common delay of all channels is "all".
    """
    if name == COMMON_DELAY:
        return "all", "delay"
    quantity, _, kind = name.rpartition("_")
    return (quantity, kind) if quantity in SENSOR_CHANNELS and kind in ERROR_KINDS else None


def error_kind(name: str) -> str:
    """Return the kind of the sensor error of nuisance `name`, an empty string if it is not a sensor error."""
    return (sensor_error(name) or ("", ""))[1]


def with_unknown_errors(
    signals: Array,
    channels: Sequence[str],
    nuisances: Mapping[str, Array],
    measured: Mapping[str, Array],
    interval: float,
) -> Array:
    """Return a model's signals with the sensor errors that are estimated.

        y(t) = (1 + s) x(t - d) + o + r t / T

    with the duration T and the drift r over it. With a negative delay, rows from beyond the end are replaced
    by the measured rows, because the model has no values there.

    Parameters
    ----------
    signals
        x of the `channels`, shape (n, channels, samples), each in its unit; changed in place.
    nuisances
        Values (n,) by name: s relative, o and r in the channel's unit, d in s; nuisances that are no sensor
        errors are ignored.
    measured
        Measured signals (samples,) by channel; a channel without one keeps its last value beyond the end.
    interval
        Time between rows [s].
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
    """Return a signal (n, samples) delayed by `delay` (n,) [s], of either sign.

    Interpolation is cubic; the signal is constant before its first row, and after the row that a parabola
    predicts to follow its last row.
    """
    rows = signal.shape[-1]
    ahead = int(np.ceil(max(-float(np.min(delay)), 0.0) / interval))
    # The row after the last one must not depend on the other delays: a parabola's next value, then constant.
    after = 3 * (signal[:, -1:] - signal[:, -2:-1]) + signal[:, -3:-2]
    longer = np.concatenate([signal, np.repeat(after, ahead + 1, axis=1)], axis=1)
    return delayed(longer, interval, delay + ahead * interval)[:, ahead : ahead + rows]
