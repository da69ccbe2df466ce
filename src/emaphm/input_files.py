"""Reading of files named by a user; irregular and too large files are refused before they are read."""

import hashlib
import stat
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from emaphm.errors import EmaphmError

MOST_TOML_BYTES = 4 * 2**20
"""Largest TOML of a description or a plan [bytes]; typical are some kB, with a large covariance 100 kB."""


def exists(path: Path, error: type[EmaphmError]) -> bool:
    """Return whether there is a file or a folder at `path`.

    Raises
    ------
    EmaphmError
        Of the type `error`: a folder on the path may not be entered, or the name is too long.
    """
    return _answer(path.exists, error, path)


def is_folder(path: Path, error: type[EmaphmError]) -> bool:
    """Return whether there is a folder at `path`; errors as of `exists`."""
    return _answer(path.is_dir, error, path)


def is_file(path: Path, error: type[EmaphmError]) -> bool:
    """Return whether there is a regular file at `path`; errors as of `exists`."""
    return _answer(path.is_file, error, path)


def _answer(question: Callable[[], bool], error: type[EmaphmError], path: Path) -> bool:
    try:
        return question()
    except OSError as failure:
        raise error(
            f"{path}: cannot be accessed ({failure.strerror}); check the path and its permissions"
        ) from None


def checked_size(path: Path, most_bytes: int, error: type[EmaphmError]) -> int:
    """Return the size of a regular file [bytes].

    Parameters
    ----------
    path
        The file.
    most_bytes
        Largest size that is accepted [bytes].
    error
        Type of the error that is raised.

    Raises
    ------
    EmaphmError
        Of the type `error`: the file is absent, a folder, a device or pipe, too large, or not accessible.
    """
    try:
        status = path.stat()
    except FileNotFoundError:
        raise error(f"{path}: no such file; check the path") from None
    except OSError as failure:
        raise error(
            f"{path}: cannot be read ({failure.strerror}); check the path and its permissions"
        ) from None
    except ValueError:  # a null character in the name
        raise error(f"{path}: no file can have this name; check the path") from None
    if stat.S_ISDIR(status.st_mode):
        raise error(f"{path}: is a folder; give a file in it")
    if not stat.S_ISREG(status.st_mode):
        # A device may be endless, and a pipe may block its reader for ever.
        raise error(f"{path}: is a device or a pipe, not a regular file; copy its content to a file first")
    if status.st_size > most_bytes:
        raise error(
            f"{path}: the file has {status.st_size / 2**20:,.0f} MiB, {most_bytes / 2**20:,.0f} MiB are read "
            "at most; give a smaller file, such as a part of a recording"
        )
    return status.st_size


def read_bytes(path: Path, most_bytes: int, error: type[EmaphmError]) -> bytes:
    """Return the content of a regular file; parameters and errors as in `checked_size`."""
    checked_size(path, most_bytes, error)
    try:
        with path.open("rb") as file:
            # Files of the operating system's kernel report the size 0 whatever their content.
            content = file.read(most_bytes + 1)
    except OSError as failure:
        raise error(
            f"{path}: cannot be read ({failure.strerror}); check the path and its permissions"
        ) from None
    if len(content) > most_bytes:
        raise error(f"{path}: more than {most_bytes / 2**20:,.0f} MiB; give a smaller file")
    return content


def is_newer_format(found: object, known: str) -> bool:
    """Return whether a file's format, such as "emaphm detector 2", has a higher number than `known`."""
    kind, _, number = known.rpartition(" ")
    if not isinstance(found, str) or not found.startswith(f"{kind} "):
        return False
    of_file = found.removeprefix(f"{kind} ")
    return of_file.isascii() and of_file.isdecimal() and float(of_file) > float(number)


def content_digest(path: Path) -> str:
    """Return the SHA-256 of a file's content, empty if it cannot be read."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except (OSError, ValueError):
        return ""


def read_toml(path: Path, what: str, error: type[EmaphmError]) -> dict[str, Any]:
    """Return the content of a TOML file.

    Parameters
    ----------
    path
        The file.
    what
        Kind of the file for error messages, e.g. "actuator file".
    error
        Type of the error that is raised.

    Raises
    ------
    EmaphmError
        Of the type `error`: the file cannot be read, or is no TOML.
    """
    if not exists(path, error) and not path.is_symlink():
        raise error(f"{path}: no such {what}; give the path of its TOML")
    content = read_bytes(path, MOST_TOML_BYTES, error)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as failure:
        raise error(f"{path}: cannot be read as a TOML text file ({failure}); give one in UTF-8") from None
    try:
        # TOML permits the line breaks \n and \r\n; files of an old Mac have \r.
        return tomllib.loads(text.replace("\r\n", "\n").replace("\r", "\n"))
    except tomllib.TOMLDecodeError as failure:
        raise error(f"{path}: not valid TOML: {failure}; correct the syntax there") from None
    except RecursionError:
        raise error(f"{path}: not valid TOML: brackets are nested too deeply; take some out") from None
    except ValueError:  # Python converts no integer of more than 4,300 digits
        raise error(f"{path}: not valid TOML: a number has too many digits; shorten it") from None
