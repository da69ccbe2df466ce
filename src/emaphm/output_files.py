"""Putting a result where it was asked to go: refused early, and never half-written."""

import errno
import os
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from emaphm.errors import OutputError

REMEDIES = {
    errno.ENOENT: "its folder is gone; create it again, or give another place",
    errno.EACCES: "make the folder writable, or give another place",
    errno.EPERM: "make the folder writable, or give another place",
    errno.EROFS: "give a place that can be written to",
}
OTHERWISE = "free space there, or give another place"
"""What to do, by what the operating system says."""


def check_writable(path: str | Path, *, force: bool = False, endings: Collection[str] = ()) -> None:
    """Refuse an output that could not be written; to be called before long work.

    Parameters
    ----------
    path
        The file to be written.
    force
        Whether an existing file may be replaced.
    endings
        The file endings that are allowed, in lower case, e.g. ``(".html",)``; any where empty.

    Raises
    ------
    OutputError
        The ending is not allowed, a file is there already, `path` is a folder or no regular file, or
        its folder is missing or not writable.
    """
    path = Path(path)
    try:
        complaint = _refusal(path, force, endings)
        if complaint is None:
            # Permission bits are no proof (root, read-only and network file systems): only trying is.
            probe = _temporary(path)
            probe.touch(exist_ok=False)
            probe.unlink()
    except (OSError, ValueError) as error:  # a null character in the name is a ValueError
        reason = getattr(error, "strerror", None) or error
        complaint = f"cannot be written there ({reason}); give another name or folder"
    if complaint:
        raise OutputError(f"{path}: {complaint}")


def _refusal(path: Path, force: bool, endings: Collection[str]) -> str | None:  # noqa: PLR0911 - one a rule
    if path.is_symlink() and not os.path.exists(path):  # noqa: PTH110 - Path.exists fails on a loop
        return "is a link to nowhere; remove the link, or give another name"
    if path.is_dir():
        return "is a folder; give the name of a file in it"
    if endings and path.suffix.lower() not in endings:
        ending = f"unknown file ending '{path.suffix}'" if path.suffix else "the name has no ending"
        return f"{ending}; end the name in {' or '.join(endings)}"
    if not path.parent.is_dir():
        what = "is not a folder" if path.parent.exists() else "does not exist"
        return f"folder '{path.parent}' {what}; create it, or give another one"
    if path.exists() and not path.is_file():
        return "is not a regular file; give another name"
    if path.exists() and not force:
        return "exists already; give another name, or --force to replace it"
    return None


def make_folder(folder: Path) -> None:
    """Make a folder for results, and those above it, where they are missing; `OutputError` if refused."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"{folder}: this folder cannot be made ({error.strerror or error}); give another place"
        ) from None


@contextmanager
def written_whole(path: str | Path) -> Iterator[Path]:
    """Yield the path of a new file, which takes the place of `path` once the block has ended well.

    Raises
    ------
    OutputError
        The operating system refuses, e.g. because the disk is full; nothing is left behind then.
    """
    # Resolved, so that a symbolic link stays one and its target is replaced.
    path = Path(path).resolve()
    temporary = _temporary(path)
    try:
        yield temporary
        temporary.replace(path)
    except OSError as error:
        remedy = REMEDIES.get(error.errno or 0, OTHERWISE)
        raise OutputError(f"{path}: cannot be written ({error.strerror or error}); {remedy}") from None
    finally:
        temporary.unlink(missing_ok=True)


def _temporary(path: Path) -> Path:
    # In the same folder, hence the same file system: only there is a rename atomic.
    return path.parent / f".{os.urandom(16).hex()}.tmp"
