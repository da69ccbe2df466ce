"""What makes a recording the same one, whatever its file is called."""

import hashlib
from collections.abc import Iterable

import numpy as np

from emaphm.errors import RecordingError
from emaphm.recording.recording import Recording


def recording_hash(recording: Recording) -> str:
    """Return the SHA-256 of a recording's channels: names, values and how they were sampled, no file name.

    The same values in another file, or in a file of another format, are the same recording.
    """
    digest = hashlib.sha256(f"{recording.sampling} {recording.samples}".encode())
    for name in sorted(recording.names):
        digest.update(f"\n{name}\n".encode("utf-8", "backslashreplace"))
        # Adding 0 makes -0.0 the 0.0 that another format may write for it.
        digest.update((np.asarray(recording[name]) + 0.0).astype("<f8").tobytes())
    return digest.hexdigest()


def check_each_once(recordings: Iterable[Recording]) -> None:
    """Refuse recordings that are the same, in whichever files: one given twice would count as two.

    Raises
    ------
    RecordingError
        Two are the same.
    """
    first: dict[str, str] = {}
    for one in recordings:
        content = recording_hash(one)
        if content in first:
            raise RecordingError(
                f"{one.source}: the same, row by row, as {first[content]}, and would count as two; leave one "
                "of the two out, or, if these are simulations, give each the noise of its sensors"
            )
        first[content] = one.source
