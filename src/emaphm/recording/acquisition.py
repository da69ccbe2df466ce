"""Model of a rig's data acquisition: sensor noise and the quantisation of analogue-to-digital converters."""

from collections.abc import Mapping

import numpy as np

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.errors import RecordingError, nearest
from emaphm.random_streams import stream
from emaphm.recording.recording import Recording
from emaphm.recording.schema import CURRENTS, SCHEMA

EXACT = ("time_s", "command_rad", "enabled")
"""Channels that the rig generates itself, which have no sensor error."""

SENSED = tuple(name for name in SCHEMA if name not in EXACT)

FEWEST_BITS, MOST_BITS = 4, 24

HOTTEST_K = 500.0
"""Full scale of a temperature channel: beyond the insulation class H (453 K) of a motor's windings."""


def acquire(
    recording: Recording,
    *,
    noise: Mapping[str, float] | None = None,
    adc_bits: int | None = None,
    full_scale: Mapping[str, float] | None = None,
    seed: int,
) -> Recording:
    """Return `recording` as a rig would have measured it.

    White Gaussian noise is added to each channel in `noise`. With `adc_bits`, a mid-tread converter of step
    2 × full scale / 2^bits then quantises each channel in `full_scale` and clips it at -full scale and at one
    step below +full scale. Time, command and columns beyond the schema stay unchanged. The noise of a channel
    has its own random stream, so that it does not depend on the other channels.

    Parameters
    ----------
    recording
        True signals.
    noise
        Noise rms by channel, in the channel's unit.
    adc_bits
        Resolution of the converters, 4 to 24 bits; no quantisation if omitted.
    full_scale
        Half the converter's range by channel, in the channel's unit, e.g. from `full_scales`; it may
        name channels that the recording lacks.
    seed
        Source of all randomness.

    Raises
    ------
    RecordingError
        A channel is unknown or not in the recording, a noise is negative, a full scale is not
        positive, or the bits are out of range or without a full scale.
    """
    noise, full_scale = noise or {}, full_scale or {}
    _check_noise(noise, recording)
    _check_converter(adc_bits, full_scale)
    columns: dict[str, Array] = dict(recording.channels)
    for name, rms in noise.items():
        samples = stream(seed, "sensor noise", name).normal(0.0, rms, recording.samples)
        columns[name] = columns[name] + samples
    if adc_bits is not None:
        for name in full_scale.keys() & columns.keys():
            columns[name] = _quantise(columns[name], adc_bits, full_scale[name])
    return recording.with_channels(columns)


def full_scales(actuator: Actuator) -> dict[str, float]:
    """Return a suitable full scale by channel, for each channel whose range the description gives.

    The full scale is twice the current or torque limit, and 1.2 times the speed limit, end stops or supply.
    """
    controller, motor, mechanics = actuator.controller, actuator.motor, actuator.mechanics
    scales = dict.fromkeys(CURRENTS, 2 * controller.current_limit)
    scales["temperature_K"] = HOTTEST_K
    if mechanics.end_stops:
        scales["position_rad"] = 1.2 * max(map(abs, mechanics.end_stops))
        scales["angle_rad"] = scales["position_rad"] / mechanics.gear_ratio
    if controller.speed_limit is not None:
        scales["speed_rad_s"] = 1.2 * controller.speed_limit
    if actuator.electrical:
        voltages = ("voltage_V", "voltage_d_V", "voltage_q_V", "supply_V")
        scales |= dict.fromkeys(voltages, 1.2 * actuator.electrical.supply)
    if motor.torque_limit is not None:
        scales["load_Nm"] = 2 * motor.torque_limit
    return scales


def _quantise(values: Array, bits: int, full_scale: float) -> Array:
    step = 2 * full_scale / 2**bits
    codes = np.clip(np.round(values / step), -(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    return np.asarray(codes * step, float)


def _check_noise(noise: Mapping[str, float], recording: Recording) -> None:
    for name, rms in noise.items():
        _check_sensed(name, "noise")
        if name not in recording:
            raise RecordingError(
                f"{recording.source}: noise for '{name}', which it lacks; leave that noise out"
            )
        if not 0 <= rms < np.inf:
            raise RecordingError(f"noise {name}={rms:g} is not an rms; give 0 or more")


def _check_converter(adc_bits: int | None, full_scale: Mapping[str, float]) -> None:
    for name, scale in full_scale.items():
        _check_sensed(name, "full scale")
        if not 0 < scale < np.inf:
            raise RecordingError(f"full scale {name}={scale:g} is impossible; give more than 0")
    if adc_bits is None:
        return
    check_bits(adc_bits)
    if not full_scale:
        raise RecordingError("adc_bits needs the full scale of each channel; give full_scale too")


def check_bits(adc_bits: int) -> None:
    """Raise `RecordingError` for a converter of fewer than 4 or more than 24 bits."""
    if not FEWEST_BITS <= adc_bits <= MOST_BITS:
        raise RecordingError(
            f"a converter of {adc_bits} bits is not known; give {FEWEST_BITS} to {MOST_BITS}"
        )


def _check_sensed(name: str, setting: str) -> None:
    if name in EXACT:
        raise RecordingError(f"{setting} for '{name}', which is known exactly; leave it out")
    if name not in SENSED:
        raise RecordingError(
            f"{setting} for unknown channel '{name}'{nearest(name, SENSED)}; correct the name"
        )
