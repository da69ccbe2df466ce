"""Whether what a function was given for a recording is one."""

from emaphm.errors import RecordingError
from emaphm.recording.recording import Recording


def check_recording(given: object) -> None:
    """Refuse what is no `Recording`, such as the name of a file.

    Raises
    ------
    RecordingError
        It is of another type.
    """
    if not isinstance(given, Recording):
        raise RecordingError(f"no recording but a {type(given).__name__}; give what read_recording returns")
