"""Compensation of described sensor errors: the recording that ideal sensors would have given."""

import math

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.sensors import IDEAL
from emaphm.errors import MethodError
from emaphm.estimation.sensors.sensor_model import shifted, true_values
from emaphm.recording import Recording

LEAST_ROWS = 4
"""Least number of rows after the compensation of a delay: the interpolation is cubic."""


def as_by_ideal_sensors(recording: Recording, actuator: Actuator) -> Recording:
    """Return the recording that ideal sensors would have given, except for noise and rounding.

        x(t) = z(t + d) + T dz/dt(t + d),   z = (y - o) / (1 + s)

    with the described lag T, delay d, scale s and zero o of each sensor. Differences compensate a lag and
    increase the noise: a low-pass has to follow. Channels of which only the magnitude was recorded are left
    out. The last rows are also left out, because delayed channels do not contain their values.

    Raises
    ------
    MethodError
        A sensor's delay is as long as the recording.
    """
    sensors = {name: actuator.sensors.of(name) for name in recording}
    if all(sensor == IDEAL for sensor in sensors.values()):
        return recording
    interval, latest = recording.interval_s, max(sensor.delay for sensor in sensors.values())
    if latest > (recording.samples - LEAST_ROWS) * interval:
        raise MethodError(
            f"a sensor with a delay of {latest:g} s shows nothing of {recording.source}, which has "
            f"{recording.duration_s:g} s; correct it under [sensors] in the actuator's TOML"
        )
    rows = recording.samples - math.ceil(latest / interval - 1e-9)
    channels = {}
    for name, sensor in sensors.items():
        if sensor.unsigned:
            continue
        recorded = np.unwrap(recording[name]) if name == "angle_rad" else recording[name]
        values = true_values(recorded, name, actuator)
        if sensor.lag:
            values = values + sensor.lag * np.gradient(values, interval)
        channels[name] = shifted(values[np.newaxis], interval, np.array([-sensor.delay]))[0, :rows]
    return recording.with_channels(channels)
