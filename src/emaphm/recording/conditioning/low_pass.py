"""Zero-phase low-pass filter of the measured channels."""

from collections.abc import Collection

import numpy as np

from emaphm.errors import RecordingError
from emaphm.recording.conditioning.interpolation import HELD, continuous
from emaphm.recording.recording import Recording
from emaphm.recording.schema import SCHEMA

ORDER = 2
"""Order of the Butterworth filter, which runs forward and backward [-]: four in total."""

NOT_FILTERED = ("time_s", "command_rad", *HELD)

HALF_POWER = (np.sqrt(2) - 1) ** (1 / (2 * ORDER))
"""Bandwidth of the filter run in both directions, relative to one direction [-]: |H|² = 1 / (1 + (f/f_c)^4)
is 1/√2 at f = f_c (√2 - 1)^(1/4), with frequencies warped by the bilinear transform, tan(π f / rate)."""


def low_passed(recording: Recording, bandwidth_hz: float, constants: Collection[str]) -> Recording:
    """Return a recording whose measured channels are filtered forward and backward, with a note.

    Parameters
    ----------
    recording
        Recording at a constant rate.
    bandwidth_hz
        Frequency at which amplitudes fall to 1/√2 [Hz].
    constants
        Channels that were not measured.

    Raises
    ------
    RecordingError
        The bandwidth is not below half the row rate, or the recording is shorter than one period of it.
    """
    from scipy.signal import butter, sosfiltfilt

    rate = recording.sample_rate_hz
    if bandwidth_hz >= rate / 2:
        raise RecordingError(
            f"{recording.source}: low_pass_hz = {bandwidth_hz:g} needs more than {2 * bandwidth_hz:g} rows "
            f"a second, they come at {rate:.4g} Hz; take it out of [reading] in the actuator's TOML"
        )
    if bandwidth_hz * recording.duration_s < 1:
        raise RecordingError(
            f"{recording.source}: low_pass_hz = {bandwidth_hz:g} leaves nothing of a recording of "
            f"{recording.duration_s:.3g} s; give more than {1 / recording.duration_s:.3g}, and well above "
            "what the manoeuvre has"
        )
    corner = rate / np.pi * np.arctan(np.tan(np.pi * bandwidth_hz / rate) / HALF_POWER)
    sections = butter(ORDER, corner, fs=rate, output="sos")
    channels = dict(recording.channels)
    excluded = {*NOT_FILTERED, *constants}
    filtered = [name for name in channels if name in SCHEMA and name not in excluded]
    for name in filtered:
        values = continuous(channels[name]) if name == "angle_rad" else channels[name]
        channels[name] = np.asarray(sosfiltfilt(sections, values), float)
    note = f"{', '.join(filtered)}: zero-phase low-pass with a bandwidth of {bandwidth_hz:g} Hz"
    return recording.with_channels(channels, [note])
