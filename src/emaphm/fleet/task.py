"""Diagnosis of the recordings in one file: the task of a worker."""

from pathlib import Path
from typing import Any

from emaphm.actuator import Actuator
from emaphm.diagnosis import deciding_code as diagnosis
from emaphm.errors import EmaphmError, RecordingError
from emaphm.execution.revision import check_revision, revision_of
from emaphm.fleet.settings import DiagnosisSettings
from emaphm.fleet.sources import FileReading, recordings_in
from emaphm.input_files import content_digest
from emaphm.recording import Recording

DECIDING = (*diagnosis.DECIDING, "amortized", "fleet/task.py", "fleet/settings.py", "fleet/sources.py")
"""The sub-packages and files whose code decides the result of a recording."""


def revision() -> str:
    """Return a fingerprint of the code and libraries that decide a diagnosis."""
    return revision_of(DECIDING, diagnosis.NOT_DECIDING)


def perform(
    path: str,
    actuator: Actuator,
    settings: DiagnosisSettings,
    reading: FileReading,
    expected: str,
    content: str | None,
) -> list[dict[str, Any]]:
    """Return the values of `emaphm diagnose --json` for each recording in the file at `path`.

    A recording that cannot be diagnosed has its name and the `error`. `expected` is the required revision of
    the code, empty for any; `content` is the required digest of the file, None for any.

    Raises
    ------
    ExecutionError
        The code of this worker has another revision.
    """
    if expected:
        check_revision(revision(), expected, "batch")
    try:
        recordings = _recordings(Path(path), actuator, reading, content)
    except EmaphmError as error:
        return [broken(path, str(error))]
    return [_diagnosed(recording, actuator, settings) for recording in recordings]


def _recordings(path: Path, actuator: Actuator, reading: FileReading, content: str | None) -> list[Recording]:
    """Return the recordings in a file; `RecordingError` if its digest is no longer `content`."""
    # Checked before and after reading: a batch may take hours, and others may write to its files.
    before = content if content is None else content_digest(path)
    recordings = recordings_in(path, actuator, reading)
    if content is not None and (before != content or content_digest(path) != content):
        raise RecordingError(f"{path}: has changed since the batch began; give the same command again")
    return recordings


def broken(recording: str, error: str) -> dict[str, Any]:
    """Return the result of a recording that cannot be diagnosed."""
    return {"recording": recording, "error": error}


def is_whole(results: list[dict[str, Any]]) -> bool:
    """Return whether all recordings of a file were diagnosed; otherwise a later call tries again."""
    return not any("error" in result for result in results)


def _diagnosed(recording: Recording, actuator: Actuator, settings: DiagnosisSettings) -> dict[str, Any]:
    try:
        return settings.diagnosed(recording, actuator).to_dict()
    except EmaphmError as error:
        return broken(recording.source, str(error))
