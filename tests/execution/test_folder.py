"""The folder of long work: one process at a time works in it, and removes it from nobody else."""

from pathlib import Path

import pytest

from emaphm.errors import ExecutionError
from emaphm.execution.folder import WorkFolder


@pytest.fixture
def folder(tmp_path: Path) -> WorkFolder:
    """Return a folder that work has begun in."""
    made = WorkFolder(tmp_path / "work", "settings.json", "trial", ExecutionError)
    made.begin("{}")
    return made


def test_a_folder_is_not_removed_from_who_works_in_it(folder: WorkFolder) -> None:
    with folder.locked():
        folder.remove()
        assert folder.settings.exists()
    folder.remove()
    assert list(folder.path.parent.iterdir()) == []


def test_what_a_killed_process_left_is_cleared_in_all_folders_and_nothing_else(folder: WorkFolder) -> None:
    inner = folder.path / "recordings" / "SN-1"
    inner.mkdir(parents=True)
    left, kept = inner / f".{'0123' * 8}.tmp", inner / "flight.tmp"
    for path in (left, kept):
        path.touch()
    folder.clear()
    assert list(inner.iterdir()) == [kept]


def test_a_folder_that_is_removed_before_it_is_locked_is_said_to_be(folder: WorkFolder) -> None:
    folder.remove()  # by another process that has done all of the work
    with pytest.raises(ExecutionError, match="has been removed meanwhile; start again"), folder.locked():
        pass


def test_a_folder_that_is_removed_before_its_lock_is_had_is_not_worked_in(
    folder: WorkFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    def removed_meanwhile(*_: object) -> None:
        folder.path.rename(folder.path.with_name("away"))

    monkeypatch.setattr("emaphm.execution.folder.fcntl.flock", removed_meanwhile)
    with pytest.raises(ExecutionError, match="has been removed meanwhile"), folder.locked():
        pass
