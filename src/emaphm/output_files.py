"""Writing of result files: invalid places are refused early, and no file is left half-written."""

import errno
import io
import os
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from emaphm.errors import OutputError

if TYPE_CHECKING:
    import polars as pl

TABLES = (".csv", ".parquet")
"""Endings of the files that `write_table` writes."""

REMEDIES = {
    errno.ENOENT: "its folder is gone; create it again, or give another place",
    errno.EACCES: "make the folder writable, or give another place",
    errno.EPERM: "make the folder writable, or give another place",
    errno.EROFS: "give a place that can be written to",
}
"""Remedies by error number of the operating system."""

OTHERWISE = "free space there, or give another place"
"""Remedy for all other errors."""


def check_writable(path: str | Path, *, force: bool = False, endings: Collection[str] = ()) -> None:
    """Refuse an output file that cannot be written; to be called before long computations.

    Parameters
    ----------
    path
        The file to be written.
    force
        Whether an existing file may be replaced.
    endings
        The allowed file endings in lower case, e.g. ``(".html",)``; if empty, all endings are allowed.

    Raises
    ------
    OutputError
        The ending is not allowed, the file exists already, `path` is a folder or no regular file, or its
        folder is missing or not writable.
    """
    path = Path(path)
    try:
        reason = _refusal(path, force, endings)
        if reason is None:
            # Permission bits are not reliable (root, read-only and network file systems): a file is created.
            probe = _temporary(path)
            probe.touch(exist_ok=False)
            probe.unlink()
    except (OSError, ValueError) as error:  # a null character in the name is a ValueError
        cause = getattr(error, "strerror", None) or error
        reason = f"cannot be written there ({cause}); give another name or folder"
    if reason:
        raise OutputError(f"{path}: {reason}")


def _refusal(path: Path, force: bool, endings: Collection[str]) -> str | None:  # noqa: PLR0911 - one a rule
    """Return the reason why `path` is refused, with its remedy, or None."""
    if path.is_symlink() and not os.path.exists(path):  # noqa: PTH110 - Path.exists fails on a loop
        return "is a link to nowhere; remove the link, or give another name"
    if path.is_dir():
        return "is a folder; give the name of a file in it"
    if endings and path.suffix.lower() not in endings:
        ending = f"unknown file ending '{path.suffix}'" if path.suffix else "the name has no ending"
        return f"{ending}; end the name in {' or '.join(endings)}"
    if not path.parent.is_dir():
        problem = "is not a folder" if path.parent.exists() else "does not exist"
        return f"folder '{path.parent}' {problem}; create it, or give another one"
    if path.exists() and not path.is_file():
        return "is not a regular file; give another name"
    if path.exists() and not force:
        return "exists already; give another name, or --force to replace it"
    return None


def make_folder(folder: Path) -> None:
    """Create a folder for results, and its parents, if they are missing; `OutputError` if that fails."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"{folder}: this folder cannot be created ({error.strerror or error}); give another place"
        ) from None


def remove_earlier(path: Path) -> None:
    """Remove a file that an earlier run of the same command has written; `OutputError` if that fails."""
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(
            f"{path}: of an earlier run, cannot be removed ({error.strerror or error}); remove it, or give "
            "another folder"
        ) from None


@contextmanager
def written_whole(path: str | Path) -> Iterator[Path]:
    """Yield the path of a temporary file, which replaces `path` when the block has ended without an error.

    Raises
    ------
    OutputError
        The operating system refuses, e.g. because the disk is full; the temporary file is then removed.
    """
    # Resolved, so that a symbolic link is kept and its target is replaced.
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


def write_table(table: "pl.DataFrame", path: str | Path, *, quote_texts: bool = False) -> None:
    """Write a table as Parquet if `path` ends so, otherwise as CSV; errors as of `written_whole`.

    `quote_texts` puts all texts of a CSV in quotes, to distinguish them from numbers.
    """
    # Written through memory, because polars' errors for a full disk differ between formats.
    content = io.BytesIO()
    if Path(path).suffix.lower() == ".parquet":
        table.write_parquet(content)
    else:
        table.write_csv(content, quote_style="non_numeric" if quote_texts else "necessary")
    with written_whole(path) as temporary:
        temporary.write_bytes(content.getbuffer())


def _temporary(path: Path) -> Path:
    # In the same folder, hence on the same file system: a rename is atomic only there.
    return path.parent / f".{os.urandom(16).hex()}.tmp"
