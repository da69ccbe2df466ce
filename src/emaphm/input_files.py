"""Reading a file that a user names; what is no regular file, or too large, is refused before it is read."""

import hashlib
import stat
import tomllib
from pathlib import Path
from typing import Any

from emaphm.errors import EmaphmError

MOST_TOML_BYTES = 4 * 2**20
"""Largest text of a description or a plan [bytes]; they have some kilobytes, a large covariance has 100."""


def checked_size(path: Path, most_bytes: int, error: type[EmaphmError]) -> int:
    """Return the size of a regular file [bytes].

    Parameters
    ----------
    path
        The file.
    most_bytes
        Largest size that is accepted [bytes].
    error
        What is raised.

    Raises
    ------
    EmaphmError
        Of the type `error`: the file is absent, a folder, a device or pipe, too large, or not accessible.
    """
    try:
        found = path.stat()
    except FileNotFoundError:
        raise error(f"{path}: no such file; check the path") from None
    except OSError as failure:
        raise error(
            f"{path}: cannot be read ({failure.strerror}); check the path and its permissions"
        ) from None
    except ValueError:  # a null character in the name
        raise error(f"{path}: no file can have this name; check the path") from None
    if stat.S_ISDIR(found.st_mode):
        raise error(f"{path}: is a folder; give a file in it")
    if not stat.S_ISREG(found.st_mode):
        # A device may be endless, and a pipe may keep its reader waiting for ever.
        raise error(f"{path}: is no regular file but a device or a pipe; copy what it gives to a file first")
    if found.st_size > most_bytes:
        raise error(
            f"{path}: the file has {found.st_size / 2**20:,.0f} MiB, {most_bytes / 2**20:,.0f} MiB are read "
            "at most; export less of it"
        )
    return found.st_size


def read_bytes(path: Path, most_bytes: int, error: type[EmaphmError]) -> bytes:
    """Return the content of a regular file; parameters and errors as in `checked_size`."""
    checked_size(path, most_bytes, error)
    try:
        with path.open("rb") as file:
            # The kernel's own files have the size 0 whatever they hold.
            content = file.read(most_bytes + 1)
    except OSError as failure:
        raise error(
            f"{path}: cannot be read ({failure.strerror}); check the path and its permissions"
        ) from None
    if len(content) > most_bytes:
        raise error(f"{path}: more than {most_bytes / 2**20:,.0f} MiB; give a smaller file")
    return content


def is_newer_format(found: object, known: str) -> bool:
    """Return whether a file's format, such as "emaphm detector 2", has a higher number than `known` has."""
    kind, _, number = known.rpartition(" ")
    if not isinstance(found, str) or not found.startswith(f"{kind} "):
        return False
    of_file = found.removeprefix(f"{kind} ")
    return of_file.isascii() and of_file.isdecimal() and float(of_file) > float(number)


def content_digest(path: Path) -> str:
    """Return the SHA-256 of what a file holds, empty where it cannot be read."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except (OSError, ValueError):
        return ""


def read_toml(path: Path, what: str, error: type[EmaphmError]) -> dict[str, Any]:
    """Return what a TOML file holds.

    Parameters
    ----------
    path
        The file.
    what
        What it is, for errors: "actuator file".
    error
        What is raised.

    Raises
    ------
    EmaphmError
        Of the type `error`: the file cannot be read, or is no TOML.
    """
    if not path.exists() and not path.is_symlink():
        raise error(f"{path}: no such {what}; give the path of its TOML")
    content = read_bytes(path, MOST_TOML_BYTES, error)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as failure:
        raise error(f"{path}: cannot be read as a TOML text file ({failure}); give one in UTF-8") from None
    try:
        # TOML's line breaks are \n and \r\n, a file of an old Mac has \r.
        return tomllib.loads(text.replace("\r\n", "\n").replace("\r", "\n"))
    except tomllib.TOMLDecodeError as failure:
        raise error(f"{path}: not valid TOML: {failure}; correct the syntax there") from None
    except RecursionError:
        raise error(f"{path}: not valid TOML: brackets are nested too deeply; take some out") from None
    except ValueError:  # Python converts no integer of more than 4,300 digits
        raise error(f"{path}: not valid TOML: a number has too many digits; shorten it") from None
