"""Compensation of known delays of single channels."""

from collections.abc import Mapping

import numpy as np

from emaphm.actuator.channels import Sampling
from emaphm.arrays import Array
from emaphm.errors import RecordingError
from emaphm.recording.checks import is_uniform
from emaphm.recording.conditioning.gaps import interval_of
from emaphm.recording.conditioning.interpolation import HELD, continuous, last_state, moved

ROUNDING = 1e-6
"""Largest relative deviation of a delay from a whole number of intervals that counts as rounding [-]."""


def without_delays(
    channels: dict[str, Array], delays: Mapping[str, float], sampling: Sampling, source: str
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Return channels shifted back by their delays, and a note.

    A delay of whole rows shifts rows; for any other delay the channel is interpolated
    (`emaphm.recording.conditioning.interpolation`). Rows at the ends that a shifted channel does not cover
    are left out.

    Parameters
    ----------
    channels
        Arrays (n,) by name, finite.
    delays
        Delay of a channel relative to the others, by name [s]; negative if it is recorded early.
    sampling
        Meaning of a row: "mean" or "instant".
    source
        The file's name, for errors.

    Raises
    ------
    RecordingError
        A delay is longer than the recording, or no row is covered by all channels.
    """
    delayed = {name: delay for name, delay in delays.items() if delay and name in channels}
    if not delayed:
        return channels, ()
    time = channels["time_s"]
    duration = float(time[-1] - time[0])
    for name, delay in delayed.items():
        if abs(delay) >= duration:
            raise RecordingError(
                f"{source}: delay_s = {delay:g} of {name} is longer than the recording ({duration:.6g} s); "
                "correct it in the actuator's TOML, in s"
            )
    shifted = dict(channels)
    for name, delay in delayed.items():
        shifted[name] = _shifted_back(name, channels[name], time, delay, sampling)
    covered = np.flatnonzero(np.logical_and.reduce([np.isfinite(shifted[name]) for name in delayed]))
    if not covered.size:
        raise RecordingError(
            f"{source}: the delays in the actuator's TOML leave no row that all channels cover"
        )
    first, last = int(covered[0]), int(covered[-1]) + 1
    listed = ", ".join(f"{name} {1e3 * delay:.6g} ms" for name, delay in delayed.items())
    note = f"taken back in time by the delay that the description gives: {listed}; "
    note += f"{first} rows at the start and "
    note += f"{time.size - last} at the end left out"
    return {name: values[first:last] for name, values in shifted.items()}, (note,)


def _shifted_back(name: str, values: Array, time: Array, delay: float, sampling: Sampling) -> Array:
    """Return `values` (n,) of a channel taken `delay` [s] later, NaN at times that were not recorded."""
    rows = delay / interval_of(time)
    if is_uniform(time) and abs(rows - round(rows)) <= ROUNDING * max(1.0, abs(rows)):
        shift = round(rows)
        shifted = np.full(values.shape, np.nan)
        if shift >= 0:
            shifted[: values.size - shift] = values[shift:]
        else:
            shifted[-shift:] = values[:shift]
        return shifted
    if name in HELD:
        return np.where(time + delay <= time[-1], last_state(time, values, time + delay), np.nan)
    recorded = continuous(values) if name == "angle_rad" else values
    return moved(time, recorded, time + delay, sampling)
