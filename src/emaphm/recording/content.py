"""Identity of a recording by its content, independent of the name and format of its file."""

import hashlib
from collections.abc import Iterable

import numpy as np

from emaphm.errors import RecordingError
from emaphm.recording.recording import Recording


def recording_hash(recording: Recording) -> str:
    """Return the SHA-256 of a recording's channel names, values and sampling, without the file name.

    The same values in another file, or in a file of another format, have the same hash.
    """
    digest = hashlib.sha256(f"{recording.sampling} {recording.samples}".encode())
    for name in sorted(recording.names):
        digest.update(f"\n{name}\n".encode("utf-8", "backslashreplace"))
        # Adding 0 makes -0.0 the 0.0 that another format may write for it.
        digest.update((np.asarray(recording[name]) + 0.0).astype("<f8").tobytes())
    return digest.hexdigest()


def check_each_once(recordings: Iterable[Recording]) -> None:
    """Refuse recordings of the same content, in any files: a recording given twice would count as two.

    Raises
    ------
    RecordingError
        Two recordings have the same content.
    """
    first: dict[str, str] = {}
    for recording in recordings:
        content = recording_hash(recording)
        if content in first:
            raise RecordingError(
                f"{recording.source}: the same, row by row, as {first[content]}, and would count as two; "
                "leave one of the two out, or, if these are simulations, give each the noise of its sensors"
            )
        first[content] = recording.source
