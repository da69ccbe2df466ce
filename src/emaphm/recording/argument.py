"""Type check of an argument that must be a `Recording`."""

from emaphm.errors import RecordingError
from emaphm.recording.recording import Recording


def check_recording(given: object) -> None:
    """Refuse an argument that is not a `Recording`, such as the name of a file.

    Raises
    ------
    RecordingError
        The argument is of another type.
    """
    if not isinstance(given, Recording):
        raise RecordingError(f"no recording but a {type(given).__name__}; give what read_recording returns")
