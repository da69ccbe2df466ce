"""The work folder: only one process at a time works in it, and no other process removes it."""

from pathlib import Path

import pytest

from emaphm.errors import ExecutionError
from emaphm.execution.folder import WorkFolder


@pytest.fixture
def folder(tmp_path: Path) -> WorkFolder:
    """Return a work folder in which work has begun."""
    work_folder = WorkFolder(tmp_path / "work", "settings.json", "trial", ExecutionError)
    work_folder.begin("{}")
    return work_folder


def test_a_work_folder_in_use_is_not_removed(folder: WorkFolder) -> None:
    with folder.locked():
        folder.remove()
        assert folder.settings.exists()
    folder.remove()
    assert list(folder.path.parent.iterdir()) == []


def test_only_temporary_files_of_killed_processes_are_removed(folder: WorkFolder) -> None:
    inner = folder.path / "recordings" / "SN-1"
    inner.mkdir(parents=True)
    temporary, flight_file = inner / f".{'0123' * 8}.tmp", inner / "flight.tmp"
    for path in (temporary, flight_file):
        path.touch()
    folder.clear()
    assert list(inner.iterdir()) == [flight_file]


def test_a_folder_removed_before_it_is_locked_is_reported(folder: WorkFolder) -> None:
    folder.remove()  # by another process that has finished the work
    with pytest.raises(ExecutionError, match="has been removed meanwhile; start again"), folder.locked():
        pass


def test_a_folder_removed_before_its_lock_is_obtained_is_not_used(
    folder: WorkFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    def removed_meanwhile(*_: object) -> None:
        folder.path.rename(folder.path.with_name("away"))

    monkeypatch.setattr("emaphm.execution.folder.fcntl.flock", removed_meanwhile)
    with pytest.raises(ExecutionError, match="has been removed meanwhile"), folder.locked():
        pass
