"""Task of a batch: diagnosis of the recordings of one file, on any worker."""

from pathlib import Path
from typing import Any

from emaphm.actuator import Actuator
from emaphm.diagnosis import deciding_code as diagnosis
from emaphm.errors import EmaphmError, ExecutionError, RecordingError
from emaphm.execution.revision import revision_of
from emaphm.fleet.settings import DiagnosisSettings
from emaphm.fleet.sources import FileReading, recordings_in
from emaphm.input_files import content_digest
from emaphm.recording import Recording

DECIDING = (*diagnosis.DECIDING, "amortized", "fleet/task.py", "fleet/settings.py", "fleet/sources.py")
"""Folders and files whose code determines the diagnosis of a recording."""


def revision() -> str:
    """Return a fingerprint of the code and libraries that determine a diagnosis."""
    return revision_of(DECIDING, diagnosis.NOT_DECIDING)


def perform(
    path: str,
    actuator: Actuator,
    settings: DiagnosisSettings,
    reading: FileReading,
    expected: str,
    content: str | None,
) -> list[dict[str, Any]]:
    """Return the output of `emaphm diagnose --json` for each recording in the file at `path`.

    For a recording that cannot be diagnosed, it is its name and the `error`. A result is stored for the
    revision `expected` of the code, empty if it does not matter, and for the `content` of the file, a digest,
    or None.

    Raises
    ------
    ExecutionError
        The revision of the code on this worker differs.
    """
    if expected and revision() != expected:
        raise ExecutionError(
            f"this worker runs another version of emaphm ({revision()}; the batch's is {expected}); install "
            "the same one there"
        )
    try:
        recordings = _recordings(Path(path), actuator, reading, content)
    except EmaphmError as error:
        return [broken(path, str(error))]
    return [_diagnosed(recording, actuator, settings) for recording in recordings]


def _recordings(path: Path, actuator: Actuator, reading: FileReading, content: str | None) -> list[Recording]:
    """Return the recordings in a file, `RecordingError` if its content has changed from `content`."""
    # Checked before and after reading: a batch may take hours, and other programs may write its files.
    before = content if content is None else content_digest(path)
    recordings = recordings_in(path, actuator, reading)
    if content is not None and (before != content or content_digest(path) != content):
        raise RecordingError(f"{path}: has changed since the batch began; give the same command again")
    return recordings


def broken(recording: str, error: str) -> dict[str, Any]:
    """Return the result for a recording that cannot be diagnosed."""
    return {"recording": recording, "error": error}


def is_whole(results: list[dict[str, Any]]) -> bool:
    """Return whether all recordings of a file could be diagnosed; if not, the file is tried again later."""
    return not any("error" in result for result in results)


def _diagnosed(recording: Recording, actuator: Actuator, settings: DiagnosisSettings) -> dict[str, Any]:
    try:
        return settings.diagnosed(recording, actuator).to_dict()
    except EmaphmError as error:
        return broken(recording.source, str(error))
