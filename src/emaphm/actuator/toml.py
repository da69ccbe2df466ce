"""Actuator TOML: writing with units, and one-line messages for what is wrong in it."""

from typing import Any

from pydantic import BaseModel, ValidationError

from emaphm.actuator.quantity import unit_for
from emaphm.errors import nearest

QUIET = ("channels", "reading", "nuisances", "sensors", "model_error")
"""Sections of which only what differs from the defaults is written."""

LONGEST_QUOTED = 200
"""Longest value that a complaint quotes; a matrix would bury it."""


def write_toml(actuator: BaseModel, comments: str = "", ending: str = "") -> str:
    """Return `actuator` as TOML text, every quantity followed by its meaning and unit.

    `comments` goes on top and `ending` below all, both as comments.
    """
    import tomlkit

    document = tomlkit.document()
    for line in comments.splitlines():
        document.add(tomlkit.comment(line))
    values = actuator.model_dump(mode="json", exclude_none=True)
    coordinates = values["coordinates"]
    for name, value in values.items():
        if isinstance(value, list):
            if value:
                document.add(name, _tables(getattr(actuator, name), value, coordinates))
            continue
        if not isinstance(value, dict):
            document.add(name, value)
            continue
        section = getattr(actuator, name)
        kept = section.model_dump(mode="json", exclude_defaults=True) if name in QUIET else value
        if kept:
            document.add(name, _table(type(section), kept, coordinates))
    below = "".join(f"\n# {line}".rstrip() if line else "\n#" for line in ending.splitlines())
    return tomlkit.dumps(document) + (f"{below}\n" if below else "")


def _tables(sections: tuple[BaseModel, ...], values: list[dict[str, Any]], coordinates: str) -> Any:
    import tomlkit

    tables = tomlkit.aot()
    for section, value in zip(sections, values, strict=True):
        tables.append(_table(type(section), value, coordinates))
    return tables


def _table(section: type[BaseModel], values: dict[str, Any], coordinates: str) -> Any:
    import tomlkit

    table = tomlkit.table()
    for name, value in values.items():
        if isinstance(value, dict):
            table.add(name, _table(_section_at(section, [name]), value, coordinates))
            continue
        item = tomlkit.item(value)
        if isinstance(value, list) and any(isinstance(row, list) for row in value):
            item.multiline(True)
        extra = section.model_fields[name].json_schema_extra
        if isinstance(extra, dict):
            unit = unit_for(str(extra["unit"]), coordinates)
            item.comment(f"{unit}: {section.model_fields[name].description}")
        table.add(name, item)
    return table


def validation_message(error: ValidationError, root: type[BaseModel]) -> str:
    """Return the first of pydantic's complaints as one line: the key, what is wrong, the remedy."""
    # A misspelt key also counts as a missing one: name the misspelling, which is what to correct.
    first, *others = sorted(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
    path = [str(part) for part in first["loc"]]
    key = ".".join(path) or "description"
    more = f" (and {len(others)} more)" if others else ""
    if first["type"] == "extra_forbidden":
        known = _section_at(root, path[:-1]).model_fields
        return f"unknown key '{key}'{nearest(path[-1], known)}{more}"
    if first["type"] == "missing":
        field = _section_at(root, path[:-1]).model_fields.get(path[-1])
        meaning = f" ({field.description})" if field and field.description else ""
        return f"key '{key}' is missing{meaning}; add it{more}"
    reason = first["msg"].removeprefix("Value error, ").removeprefix("Input ")
    if not path and first["type"] == "value_error":  # about several sections: it names its key itself
        return reason + more
    given = repr(first["input"])
    got = "" if isinstance(first["input"], dict) or len(given) > LONGEST_QUOTED else f", got {given}"
    return f"'{key}': {reason}{got}{more}"


def _section_at(root: type[BaseModel], path: list[str]) -> type[BaseModel]:
    section = root
    for part in path:
        if part not in section.model_fields:  # a place in a list, or a name in a mapping
            continue
        annotation = section.model_fields[part].annotation
        candidates = [annotation, *getattr(annotation, "__args__", ())]
        below = [c for c in candidates if isinstance(c, type) and issubclass(c, BaseModel)]
        if not below:  # a value of several parts, such as end_stops
            return section
        section = below[0]
    return section
