"""Which code made a result, so that results of different code are not mixed unnoticed."""

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

ROOT = Path(__file__).parents[1]
"""The folder of the package."""

LIBRARIES = ("numpy", "scipy", "numba", "llvmlite", "cma", "minionpy", "pymoo")
"""Libraries whose numbers are part of a result."""

LENGTH = 12
"""Characters of a fingerprint."""


@cache
def revision_of(names: tuple[str, ...], left_out: tuple[str, ...]) -> str:
    """Return a fingerprint of the code in `names`, and of the libraries and Python's version.

    `names` are rooms and files of the package, `left_out` parts of these that decide no result. Docstrings,
    comments and layout do not count.
    """
    files = {
        path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
        for path in deciding_files(ROOT, names, left_out)
    }
    # To read what the code means takes seconds, in each process of a study: it is done once for these files.
    sources = _digest([*files.items(), ("", Path(__file__).read_text(encoding="utf-8"))])
    place = _place(names, left_out)
    found = _kept(place, sources)
    if found is None:
        found = _digest((name, meaning(source)) for name, source in files.items())[:LENGTH]
        _keep(place, f"{sources} {found}")
    return found


def _digest(texts: Iterable[tuple[str, str]]) -> str:
    """Return a digest of named texts, of the libraries, and of Python's version."""
    digest = hashlib.sha256(platform.python_version().rpartition(".")[0].encode())
    for name in LIBRARIES:
        digest.update(f"{name} {_version(name)}".encode())
    for name, text in texts:
        digest.update(name.encode())
        digest.update(text.encode())
    return digest.hexdigest()


def _place(names: tuple[str, ...], left_out: tuple[str, ...]) -> Path:
    """Return where the fingerprint of this code is kept: in `EMAPHM_CACHE_DIR` if set, else by the source."""
    folder = Path(os.environ.get("EMAPHM_CACHE_DIR") or Path(__file__).parent / "__pycache__")
    which = hashlib.sha256(repr((names, left_out)).encode()).hexdigest()[:8]
    return folder / f"revision-{which}.{sys.implementation.cache_tag}"


def _kept(place: Path, sources: str) -> str | None:
    """Return the fingerprint kept there, None where there is none of these `sources`."""
    try:
        of, _, found = place.read_text(encoding="ascii").partition(" ")
    except (OSError, UnicodeDecodeError):
        return None
    return found if of == sources and len(found) == LENGTH else None


def _keep(place: Path, text: str) -> None:
    """Keep a text, whole or not at all; what cannot be kept is computed anew next time."""
    part = place.with_name(f"{place.name}.{os.getpid()}")
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(text, encoding="ascii")
        part.replace(place)
    except OSError:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def deciding_files(root: Path, names: Sequence[str], left_out: Sequence[str]) -> list[Path]:
    """Return the files of `names` below `root`, the package's folder, less those `left_out`.

    Raises
    ------
    FileNotFoundError
        There is no file or folder of one of these names: what was moved would count, or not, unawares.
    """
    missing = [name for name in (*names, *left_out) if not (root / name).exists()]
    if missing:
        raise FileNotFoundError(f"{root}: no {', '.join(missing)}; correct the list of deciding code")
    others = [root / name for name in left_out]
    found: list[Path] = []
    for name in names:
        place = root / name
        found += sorted(place.rglob("*.py")) if place.is_dir() else [place]
    return [path for path in found if not any(path.is_relative_to(other) for other in others)]


def meaning(source: str) -> str:
    """Return the syntax tree of the Python `source` as text, without docstrings, comments and layout."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [statement for statement in body if not _is_text(statement)]  # type: ignore[attr-defined]
    return ast.dump(tree)


def _is_text(node: ast.stmt) -> bool:
    """Return whether a statement is a docstring, of whatever stands above it."""
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
