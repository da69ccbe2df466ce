"""Channels that are recorded late or early, brought back in time."""

from collections.abc import Mapping

import numpy as np

from emaphm.actuator.channels import Sampling
from emaphm.arrays import Array
from emaphm.errors import RecordingError
from emaphm.recording.checks import is_uniform
from emaphm.recording.conditioning.gaps import interval_of
from emaphm.recording.conditioning.interpolation import HELD, continuous, last_state, moved

WHOLE = 1e-6
"""Deviation of a delay from a whole number of intervals that is taken for rounding [-]."""


def without_delays(
    channels: dict[str, Array], delays: Mapping[str, float], sampling: Sampling, source: str
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Return channels of which each is taken as much later as it is late, and what was done.

    A delay of whole rows moves rows; others are interpolated (`emaphm.recording.conditioning.interpolation`).
    Rows at the ends that a channel does not cover then are left out.

    Parameters
    ----------
    channels
        Arrays (n,) by name, finite.
    delays
        How much later than the others a channel is recorded, by name [s]; negative if earlier.
    sampling
        What a row is.
    source
        The file's name, for errors.

    Raises
    ------
    RecordingError
        A delay is longer than the recording.
    """
    late = {name: delay for name, delay in delays.items() if delay and name in channels}
    if not late:
        return channels, ()
    time = channels["time_s"]
    duration = float(time[-1] - time[0])
    for name, delay in late.items():
        if abs(delay) >= duration:
            raise RecordingError(
                f"{source}: delay_s = {delay:g} of {name} is longer than the recording ({duration:.6g} s); "
                "correct it in the actuator's TOML, in s"
            )
    shifted = dict(channels)
    for name, delay in late.items():
        shifted[name] = _taken_later(name, channels[name], time, delay, sampling)
    covered = np.flatnonzero(np.logical_and.reduce([np.isfinite(shifted[name]) for name in late]))
    if not covered.size:
        raise RecordingError(
            f"{source}: the delays in the actuator's TOML leave no row that all channels cover"
        )
    first, last = int(covered[0]), int(covered[-1]) + 1
    listed = ", ".join(f"{name} {1e3 * delay:.6g} ms" for name, delay in late.items())
    note = f"taken back in time by the delay that the description gives: {listed}; "
    note += f"{first} rows at the start and "
    note += f"{time.size - last} at the end left out"
    return {name: values[first:last] for name, values in shifted.items()}, (note,)


def _taken_later(name: str, values: Array, time: Array, delay: float, sampling: Sampling) -> Array:
    rows = delay / interval_of(time)
    if is_uniform(time) and abs(rows - round(rows)) <= WHOLE * max(1.0, abs(rows)):
        whole = round(rows)
        taken = np.full(values.shape, np.nan)
        if whole >= 0:
            taken[: values.size - whole] = values[whole:]
        else:
            taken[-whole:] = values[:whole]
        return taken
    if name in HELD:
        return np.where(time + delay <= time[-1], last_state(time, values, time + delay), np.nan)
    recorded = continuous(values) if name == "angle_rad" else values
    return moved(time, recorded, time + delay, sampling)
