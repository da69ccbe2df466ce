"""Recordings of an actuator: schema, reading, writing, checks, equivalent current, simulated acquisition."""

from emaphm.recording.acquisition import acquire, full_scales
from emaphm.recording.equivalent_current import (
    equivalent_current,
    sinusoidal_equivalent_current,
    with_equivalent_current,
)
from emaphm.recording.io.read import (
    read_recording,
    read_recordings,
    read_signal,
    recordings_of,
)
from emaphm.recording.io.write import write_recording
from emaphm.recording.plausibility import check_plausible
from emaphm.recording.reconstruction import held, other_curve, reconstructed
from emaphm.recording.recording import Recording

__all__ = [
    "Recording",
    "acquire",
    "check_plausible",
    "equivalent_current",
    "full_scales",
    "held",
    "other_curve",
    "read_recording",
    "read_recordings",
    "read_signal",
    "reconstructed",
    "recordings_of",
    "sinusoidal_equivalent_current",
    "with_equivalent_current",
    "write_recording",
]
