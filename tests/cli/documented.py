"""Comparison of the JSON keys of an answer with the keys listed in docs/reference/json.md."""

import re
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from emaphm.actuator import NAMES

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "json.md"

ALSO = {"demo": "diagnose"}
"""Sections that refer to the keys of another section."""


GROUPS = ("detect", "fleet", "history", "study")
"""Verbs of two words."""


def undocumented(arguments: Sequence[str | Path], answer: dict[str, Any]) -> list[str]:
    """Return the keys of a command's JSON `answer` that the page does not list."""
    words = 2 if arguments[0] in GROUPS else 1
    verb = " ".join(map(str, arguments[:words]))
    rows = {*_keys().get(verb, ()), *_keys().get(ALSO.get(verb, ""), ())}
    return list(_missing(answer, (), rows))


@cache
def _keys() -> dict[str, set[tuple[str, ...]]]:
    """Return the keys by section, with one tuple element per level: `a.b[].c` is ("a", "b[]", "c")."""
    keys_by_verb: dict[str, set[tuple[str, ...]]] = {}
    for section in PAGE.read_text(encoding="utf-8").split("\n## ")[1:]:
        title, _, text = section.partition("\n")
        keys = {tuple(key.split(".")) for key in re.findall(r"^\| `([^`]+)` \|", text, re.MULTILINE)}
        for verb in re.findall(r"`([^`]+)`", title):
            keys_by_verb[verb] = keys
    return keys_by_verb


def _missing(value: Any, place: tuple[str, ...], rows: set[tuple[str, ...]]) -> Iterator[str]:
    """Yield the keys at and below `place` without a row; a row on an object covers all its keys."""
    if any(_matches(row, place) for row in rows):
        return
    listed = (*place[:-1], f"{place[-1]}[]") if place and isinstance(value, list) else place
    if not any(_matches(row[: len(listed)], listed) for row in rows):
        yield ".".join(place)
    elif isinstance(value, dict):
        for name, inner in value.items():
            yield from _missing(inner, (*place, name), rows)
    elif isinstance(value, list):
        for inner in value:
            yield from _missing(inner, listed, rows)


def _matches(row: tuple[str, ...], place: tuple[str, ...]) -> bool:
    return len(row) == len(place) and all(map(_part_matches, row, place))


def _part_matches(part: str, name: str) -> bool:
    if part == "FAULT":
        return name in NAMES
    return (
        part == name
        or (part in ("CHANNEL", "NAME") and not name.endswith("[]"))
        or (part == "NAME[]" and name.endswith("[]"))
    )
