"""Which code made a result: results of another one are not to be mixed unawares."""

import ast
import hashlib
import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import emaphm

DECIDING = (
    "actuator",
    "simulation",
    "recording",
    "optimizers",
    "estimation",
    "diagnosis",
    "calibration",
    "arrays.py",
    "quantiles.py",
    "random_streams.py",
    "simulated_recording.py",
    "study/task.py",
    "study/record.py",
    "study/foreign_plant.py",
    "study/spoilt",
)
"""The rooms and files whose code decides what a trial finds. Cases, rigs and methods are in the plan."""

NOT_DECIDING = ("recording/io", "actuator/toml.py", "diagnosis/text.py", "diagnosis/wording.py")
"""Parts of these rooms that read files or put words: a study does not pass through them."""

LIBRARIES = ("numpy", "scipy", "numba", "cma", "minionpy", "pymoo")
"""Libraries whose numbers are part of a result."""


@cache
def revision() -> str:
    """Return a fingerprint of the code and libraries that decide results, and of Python's version.

    Docstrings, comments and layout do not count, nor what draws or prints.
    """
    root = Path(emaphm.__file__).parent
    digest = hashlib.sha256(platform.python_version().rpartition(".")[0].encode())
    for name in LIBRARIES:
        digest.update(f"{name} {_version(name)}".encode())
    for path in deciding_files(root):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(meaning(path.read_text(encoding="utf-8")).encode())
    return digest.hexdigest()[:12]


def deciding_files(root: Path) -> list[Path]:
    """Return the files below `root`, the package's folder, whose code decides results."""
    left_out = [root / name for name in NOT_DECIDING]
    found: list[Path] = []
    for name in DECIDING:
        place = root / name
        found += sorted(place.rglob("*.py")) if place.is_dir() else [place]
    return [path for path in found if not any(path.is_relative_to(other) for other in left_out)]


def meaning(source: str) -> str:
    """Return the syntax tree of the Python `source` as text, without docstrings, comments and layout."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [one for one in body if not _is_text(one)]  # type: ignore[attr-defined]
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
