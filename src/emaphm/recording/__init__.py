"""What was measured: the schema, reading, writing, checks, equivalent current, acquisition."""

from emaphm.recording.acquisition import acquire, full_scales
from emaphm.recording.equivalent_current import equivalent_current, with_equivalent_current
from emaphm.recording.output import check_writable
from emaphm.recording.plausibility import check_plausible
from emaphm.recording.readers import read_recording, read_signal
from emaphm.recording.reconstruction import reconstructed
from emaphm.recording.recording import Recording
from emaphm.recording.writers import write_recording

__all__ = [
    "Recording",
    "acquire",
    "check_plausible",
    "check_writable",
    "equivalent_current",
    "full_scales",
    "read_recording",
    "read_signal",
    "reconstructed",
    "with_equivalent_current",
    "write_recording",
]
