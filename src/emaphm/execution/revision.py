"""Fingerprint of the code that computed a result, so that results of different code are not mixed."""

import ast
import hashlib
import os
import platform
import sys
from collections.abc import Iterable, Sequence
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from emaphm.errors import EmaphmError, ExecutionError

ROOT = Path(__file__).parents[1]
"""Folder of the package."""

LIBRARIES = ("numpy", "scipy", "numba", "llvmlite", "cma", "minionpy", "pymoo")
"""Libraries that influence the numbers of a result."""

LENGTH = 12
"""Length of a fingerprint [characters]."""


@cache
def revision_of(names: tuple[str, ...], left_out: tuple[str, ...]) -> str:
    """Return a fingerprint of the code in `names`, of the libraries and of Python's version.

    `names` are folders and files of the package, `left_out` parts of them that do not influence a result.
    Docstrings, comments and layout are ignored.
    """
    files = {
        path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
        for path in deciding_files(ROOT, names, left_out)
    }
    # Parsing takes seconds in each process of a study: the fingerprint is stored with a digest of the files.
    sources = _digest([*files.items(), ("", Path(__file__).read_text(encoding="utf-8"))])
    place = _stored_path(names, left_out)
    fingerprint = _stored_fingerprint(place, sources)
    if fingerprint is None:
        fingerprint = _digest((name, meaning(source)) for name, source in files.items())[:LENGTH]
        _store(place, f"{sources} {fingerprint}")
    return fingerprint


def check_revision(here: str, expected: str, work: str, error: type[EmaphmError] = ExecutionError) -> None:
    """Refuse a part of some `work` ("batch", "study") in a process whose code is not that of the work.

    `here` is the revision of this process, `expected` that of the work, both by `revision_of`.

    Raises
    ------
    ExecutionError, or `error` if given
        The revisions differ.
    """
    if here != expected:
        raise error(
            f"this worker runs another version of emaphm ({here}; the {work}'s is {expected}); install the "
            "same one there"
        )


def _digest(texts: Iterable[tuple[str, str]]) -> str:
    """Return a digest of named texts, of the libraries, and of Python's version."""
    digest = hashlib.sha256(platform.python_version().rpartition(".")[0].encode())
    for name in LIBRARIES:
        digest.update(f"{name} {_version(name)}".encode())
    for name, text in texts:
        digest.update(name.encode())
        digest.update(text.encode())
    return digest.hexdigest()


def _stored_path(names: tuple[str, ...], left_out: tuple[str, ...]) -> Path:
    """Return the path of the stored fingerprint: in `EMAPHM_CACHE_DIR` if set, otherwise in `__pycache__`."""
    folder = Path(os.environ.get("EMAPHM_CACHE_DIR") or Path(__file__).parent / "__pycache__")
    number = hashlib.sha256(repr((names, left_out)).encode()).hexdigest()[:8]
    return folder / f"revision-{number}.{sys.implementation.cache_tag}"


def _stored_fingerprint(place: Path, sources: str) -> str | None:
    """Return the fingerprint stored at `place`; None if there is none for these `sources`."""
    try:
        stored_sources, _, fingerprint = place.read_text(encoding="ascii").partition(" ")
    except (OSError, UnicodeDecodeError):
        return None
    return fingerprint if stored_sources == sources and len(fingerprint) == LENGTH else None


def _store(place: Path, text: str) -> None:
    """Store a text atomically; if it cannot be stored, the next process computes it again."""
    part = place.with_name(f"{place.name}.{os.getpid()}")
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(text, encoding="ascii")
        part.replace(place)
    except OSError:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def deciding_files(root: Path, names: Sequence[str], left_out: Sequence[str]) -> list[Path]:
    """Return the files of `names` below `root`, the package's folder, except those in `left_out`.

    Raises
    ------
    FileNotFoundError
        There is no file or folder with one of these names: moved code would be left out unnoticed.
    """
    missing = [name for name in (*names, *left_out) if not (root / name).exists()]
    if missing:
        raise FileNotFoundError(f"{root}: no {', '.join(missing)}; correct the list of deciding code")
    excluded = [root / name for name in left_out]
    files: list[Path] = []
    for name in names:
        place = root / name
        files += sorted(place.rglob("*.py")) if place.is_dir() else [place]
    return [path for path in files if not any(path.is_relative_to(folder) for folder in excluded)]


def meaning(source: str) -> str:
    """Return the syntax tree of the Python `source` as text, without docstrings, comments and layout."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [statement for statement in body if not _is_text(statement)]  # type: ignore[attr-defined]
    return ast.dump(tree)


def _is_text(node: ast.stmt) -> bool:
    """Return whether a statement is a string, such as a docstring or the description of a constant."""
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "none"
