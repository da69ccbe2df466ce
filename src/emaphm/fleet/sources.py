"""Sources of recordings: files and folders that the user names, and the recordings in a file."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from emaphm.actuator import Actuator
from emaphm.errors import RecordingError
from emaphm.input_files import is_folder
from emaphm.recording import Recording, read_recordings
from emaphm.recording.io.read import READERS


def recording_files(paths: Iterable[Path]) -> list[Path]:
    """Return the files that `paths` name: the files themselves, and the recordings in folders by name.

    Hidden files in a folder, and files without the ending of a recording, are left out.

    Raises
    ------
    RecordingError
        A folder holds no recording or cannot be read, or a file is named twice.
    """
    files: list[Path] = []
    for path in paths:
        files += _files_in(path) if is_folder(path, RecordingError) else [path]
    twice = next((path for path in files if files.count(path) > 1), None) if _has_repeats(files) else None
    if twice is not None:
        raise RecordingError(f"{twice}: is named twice; name each recording once")
    return files


@dataclass(frozen=True)
class FileReading:
    """How the files of a batch are read: the arguments of `emaphm.read_recordings` by the same names."""

    split: str | None = None
    known: Mapping[str, float | str] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Return the settings, ready for `json.dumps`."""
        return {"split": self.split, "known": dict(self.known)}


def recordings_in(path: Path, actuator: Actuator, reading: FileReading) -> list[Recording]:
    """Return the recordings of `actuator` in the file at `path`; errors as in `read_recordings`."""
    return read_recordings(path, actuator, split=reading.split, known=reading.known)


def _has_repeats(files: list[Path]) -> bool:
    return len(set(files)) < len(files)


def _files_in(folder: Path) -> list[Path]:
    try:
        files = sorted(
            path
            for path in folder.iterdir()
            if path.suffix.lower() in READERS and not path.name.startswith(".") and path.is_file()
        )
    except OSError as error:
        raise RecordingError(f"{folder}: cannot be read ({error.strerror}); check its permissions") from None
    if not files:
        raise RecordingError(
            f"{folder}: is a folder without recordings ({', '.join(READERS)}); name another one, or the files"
        )
    return files
