"""Where recordings come from: files and folders named by the user, and what a file holds."""

from collections.abc import Iterable
from pathlib import Path

from emaphm.actuator import Actuator
from emaphm.errors import RecordingError
from emaphm.recording import Recording, read_recording
from emaphm.recording.io.read import READERS


def recording_files(paths: Iterable[Path]) -> list[Path]:
    """Return the files that `paths` name: themselves, and of a folder its recordings, by name.

    A folder's hidden files are left out, and files with other endings than those of recordings.

    Raises
    ------
    RecordingError
        A folder holds no recording or cannot be read, or a file is named twice.
    """
    files: list[Path] = []
    for path in paths:
        files += _of_folder(path) if path.is_dir() else [path]
    twice = next((path for path in files if files.count(path) > 1), None) if _repeats(files) else None
    if twice is not None:
        raise RecordingError(f"{twice}: is named twice; name each recording once")
    return files


def recordings_in(path: Path, actuator: Actuator) -> list[Recording]:
    """Return the recordings of `actuator` in the file at `path`; errors as in `read_recording`."""
    return [read_recording(path, actuator)]


def _repeats(files: list[Path]) -> bool:
    return len(set(files)) < len(files)


def _of_folder(folder: Path) -> list[Path]:
    try:
        found = sorted(
            path
            for path in folder.iterdir()
            if path.suffix.lower() in READERS and not path.name.startswith(".") and path.is_file()
        )
    except OSError as error:
        raise RecordingError(f"{folder}: cannot be read ({error.strerror}); check its permissions") from None
    if not found:
        raise RecordingError(
            f"{folder}: is a folder without recordings ({', '.join(READERS)}); name another one, or the files"
        )
    return found
