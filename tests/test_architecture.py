"""Architecture of the package: imports in one direction, no circular imports, and limited size."""

import ast
import re
from functools import cache
from pathlib import Path

from imports import MODULES, imported, tree_of

PAGE = Path(__file__).parents[1] / "docs" / "architecture.md"

ORDER = (
    (
        "errors",
        "arrays",
        "identity_cache",
        "blas_threads",
        "threads",
        "version",
        "progress",
        "text_table",
        "optional_library",
        "memory",
        "quantiles",
        "strict_json",
    ),
    ("random_streams", "output_files", "input_files"),
    ("optimizers", "execution", "actuator"),
    ("simulation",),
    ("recording",),
    ("simulated_recording",),
    ("estimation",),
    ("diagnosis",),
    ("calibration", "experiment", "amortized"),
    ("detection", "history"),
    ("prognosis",),
    ("fleet",),
    ("monitoring",),
    ("study",),
    ("plotting",),
    ("report",),
    ("server",),
    ("demo", "environment", "first_description"),
    ("cli",),
    ("__main__",),
)
"""Rooms from the lowest; a room imports from lower rooms and from itself."""

LEVEL = {room: level for level, rooms in enumerate(ORDER) for room in rooms}

CARRIES = {("emaphm.diagnosis.result", "emaphm.detection.result")}
"""A result that holds a result of a higher room, imported only as a type."""

MOST_LINES = 2500
"""Limit for a sub-package."""


def room(module: str) -> str:
    return module.split(".")[1] if "." in module else ""


@cache
def loaded(name: str) -> set[str]:
    """Return the modules that a module imports at load time."""
    return set(imported(tree_of(name), when_called=False)) - {name}


def called(name: str) -> set[str]:
    """Return the modules that a module imports at load time or in functions."""
    return set(imported(tree_of(name), when_called=True)) - {name}


def test_each_file_is_in_a_room_of_the_order() -> None:
    assert {room(name) for name in MODULES} - {""} == set(LEVEL)


def test_the_table_of_rooms_has_the_same_order() -> None:
    rows = re.findall(r"^\| (\d+) \| (`.*?) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    listed = [(int(level), name) for level, rooms in rows for name in re.findall(r"`(\w+)/?`", rooms)]
    assert [level for level, _ in listed] == sorted(level for level, _ in listed)
    assert sorted(listed) == sorted((level + 1, name) for name, level in LEVEL.items())


@cache
def named(name: str) -> set[str]:
    """Return the modules that a module imports at load time, in functions, or only for types."""
    return set(imported(tree_of(name), when_called=True, for_types=True)) - {name}


def points_up(name: str, other: str) -> bool:
    """Return whether `other` is in a higher room than the module `name`, or in another room of its level."""
    own, level = LEVEL[room(name)], LEVEL.get(room(other), -1)
    peers = ("progress", "text_table", "arrays", "errors", room(name))
    return level > own or (level == own and room(other) not in peers)


def test_imports_have_one_direction() -> None:
    in_rooms = [name for name in MODULES if room(name)]
    wrong = {(name, other) for name in in_rooms for other in loaded(name) if points_up(name, other)}
    assert wrong == set()


def test_imports_for_types_have_one_direction() -> None:
    in_rooms = [name for name in MODULES if room(name)]
    types = {(name, other) for name in in_rooms for other in named(name) - called(name)}
    assert {(name, other) for name, other in types if points_up(name, other)} == CARRIES


def test_functions_import_only_the_plotting_room_from_above() -> None:
    for name in MODULES:
        for other in called(name) - loaded(name):
            if room(name) and LEVEL[room(other)] > LEVEL[room(name)]:
                assert room(other) == "plotting", f"{name} imports {other}"


def followed(name: str) -> set[str]:
    """Return all imports of a module (load time, functions, types) except its plotting module."""
    return {other for other in named(name) if room(other) != "plotting" or room(name) == "plotting"}


def test_there_are_no_circular_imports() -> None:
    done: set[str] = set()

    def visit(name: str, path: tuple[str, ...]) -> None:
        assert name not in path, " imports ".join((*path[path.index(name) :], name))
        if name in done:
            return
        for other in followed(name):
            visit(other, (*path, name))
        done.add(name)

    for name in MODULES:
        visit(name, ())


def test_no_sub_package_is_too_large() -> None:
    lines: dict[str, int] = {}
    for name, path in MODULES.items():
        package = name.rpartition(".")[0] if path.name != "__init__.py" else name
        lines[package] = lines.get(package, 0) + len(path.read_text(encoding="utf-8").splitlines())
    assert {package: count for package, count in lines.items() if count > MOST_LINES} == {}


def test_rooms_below_plotting_do_not_import_matplotlib() -> None:
    for name, path in MODULES.items():
        below = LEVEL.get(room(name), 99) < LEVEL["plotting"]
        if below and "matplotlib" in path.read_text(encoding="utf-8"):
            names = {a.name for n in ast.walk(tree_of(name)) if isinstance(n, ast.Import) for a in n.names}
            assert not {imported_name for imported_name in names if imported_name.startswith("matplotlib")}, (
                name
            )
