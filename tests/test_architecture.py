"""The rooms of the package: imports point one way, no two files import each other, and none is too large."""

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
"""Rooms from the lowest; one imports from those before it, and from itself."""

LEVEL = {room: level for level, rooms in enumerate(ORDER) for room in rooms}

CARRIES = {("emaphm.diagnosis.result", "emaphm.detection.result")}
"""A result that carries one of a higher room, which it knows by its type alone."""

MOST_LINES = 2500
"""Of a sub-package."""


def room(module: str) -> str:
    return module.split(".")[1] if "." in module else ""


@cache
def loaded(name: str) -> set[str]:
    """Return the modules that one imports as it is loaded."""
    return set(imported(tree_of(name), when_called=False)) - {name}


def called(name: str) -> set[str]:
    """Return the modules that one imports as it is loaded or called."""
    return set(imported(tree_of(name), when_called=True)) - {name}


def test_every_file_stands_in_a_room_of_the_order() -> None:
    assert {room(name) for name in MODULES} - {""} == set(LEVEL)


def test_the_table_of_rooms_has_the_order() -> None:
    rows = re.findall(r"^\| (\d+) \| (`.*?) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    found = [(int(level), name) for level, rooms in rows for name in re.findall(r"`(\w+)/?`", rooms)]
    assert [level for level, _ in found] == sorted(level for level, _ in found)
    assert sorted(found) == sorted((level + 1, name) for name, level in LEVEL.items())


@cache
def named(name: str) -> set[str]:
    """Return the modules that one imports as it is loaded or called, or for its types alone."""
    return set(imported(tree_of(name), when_called=True, for_types=True)) - {name}


def points_up(name: str, other: str) -> bool:
    """Return whether `other` stands above the module `name`, or beside it in another room."""
    own, level = LEVEL[room(name)], LEVEL.get(room(other), -1)
    peers = ("progress", "text_table", "arrays", "errors", room(name))
    return level > own or (level == own and room(other) not in peers)


def test_imports_point_one_way() -> None:
    in_rooms = [name for name in MODULES if room(name)]
    wrong = {(name, other) for name in in_rooms for other in loaded(name) if points_up(name, other)}
    assert wrong == set()


def test_types_point_one_way() -> None:
    in_rooms = [name for name in MODULES if room(name)]
    types = {(name, other) for name in in_rooms for other in named(name) - called(name)}
    assert {(name, other) for name, other in types if points_up(name, other)} == CARRIES


def test_when_called_a_result_may_reach_down_to_its_drawer_only() -> None:
    for name in MODULES:
        for other in called(name) - loaded(name):
            if room(name) and LEVEL[room(other)] > LEVEL[room(name)]:
                assert room(other) == "plotting", f"{name} imports {other}"


def followed(name: str) -> set[str]:
    """Return what a module imports, loaded, called or for types, but its drawer."""
    return {other for other in named(name) if room(other) != "plotting" or room(name) == "plotting"}


def test_no_circles() -> None:
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


def test_the_science_knows_no_figure_library() -> None:
    for name, path in MODULES.items():
        below = LEVEL.get(room(name), 99) < LEVEL["plotting"]
        if below and "matplotlib" in path.read_text(encoding="utf-8"):
            names = {a.name for n in ast.walk(tree_of(name)) if isinstance(n, ast.Import) for a in n.names}
            assert not {one for one in names if one.startswith("matplotlib")}, name
