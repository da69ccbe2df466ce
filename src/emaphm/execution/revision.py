"""Which code made a result, so that results of different code are not mixed unnoticed."""

import ast
import hashlib
import platform
from collections.abc import Sequence
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import emaphm

LIBRARIES = ("numpy", "scipy", "numba", "llvmlite", "cma", "minionpy", "pymoo")
"""Libraries whose numbers are part of a result."""


@cache
def revision_of(names: tuple[str, ...], left_out: tuple[str, ...]) -> str:
    """Return a fingerprint of the code in `names`, and of the libraries and Python's version.

    `names` are rooms and files of the package, `left_out` parts of these that decide no result. Docstrings,
    comments and layout do not count.
    """
    root = Path(emaphm.__file__).parent
    digest = hashlib.sha256(platform.python_version().rpartition(".")[0].encode())
    for name in LIBRARIES:
        digest.update(f"{name} {_version(name)}".encode())
    for path in deciding_files(root, names, left_out):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(meaning(path.read_text(encoding="utf-8")).encode())
    return digest.hexdigest()[:12]


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
