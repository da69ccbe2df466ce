"""Processes that others have started, by Linux's `/proc`."""

from pathlib import Path


def children(parent: int) -> list[int]:
    """Return the processes that `parent` has started."""
    every = [int(path.name) for path in Path("/proc").iterdir() if path.name.isdecimal()]
    return [process for process in every if _stat(process)[1:2] == [str(parent)]]


def lives(process: int) -> bool:
    """Return whether there is such a process."""
    # One that has ended is Z until its parent has asked how.
    return _stat(process)[:1] not in ([], ["Z"])


def has_loaded(process: int, library: str) -> bool:
    """Return whether a process has a library in its memory, a part of whose path is given."""
    try:
        return library in Path(f"/proc/{process}/maps").read_text(encoding="utf-8")
    except OSError:
        return False


def _stat(process: int) -> list[str]:
    """Return state, parent and so on; empty where there is no such process."""
    try:
        return Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    except OSError:
        return []
