"""Child processes and loaded libraries, read from Linux's `/proc`."""

from pathlib import Path


def children(parent: int) -> list[int]:
    """Return the child processes of `parent`."""
    all_processes = [int(path.name) for path in Path("/proc").iterdir() if path.name.isdecimal()]
    return [process for process in all_processes if _stat(process)[1:2] == [str(parent)]]


def lives(process: int) -> bool:
    """Return whether the process exists and has not ended."""
    # A process that has ended has the state Z until its parent reads its exit code.
    return _stat(process)[:1] not in ([], ["Z"])


def has_loaded(process: int, library: str) -> bool:
    """Return whether a process has loaded a library, given by a part of its path."""
    try:
        return library in Path(f"/proc/{process}/maps").read_text(encoding="utf-8")
    except OSError:
        return False


def _stat(process: int) -> list[str]:
    """Return state, parent and further fields; empty if the process does not exist."""
    try:
        return Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    except OSError:
        return []
