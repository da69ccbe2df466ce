"""Writing an actuator as TOML, each quantity with its meaning and unit."""

from typing import Any

from pydantic import BaseModel

from emaphm.actuator.quantity import unit_for
from emaphm.actuator.toml.sections import section_at

QUIET = ("channels", "reading", "nuisances", "sensors", "model_error")
"""Sections of which only values that differ from the defaults are written."""


def write_toml(actuator: BaseModel, comments: str = "", ending: str = "") -> str:
    """Return `actuator` as TOML text, each quantity followed by its meaning and unit.

    `comments` is written at the top and `ending` at the end, both as comments.
    """
    import tomlkit

    document = tomlkit.document()
    for line in comments.splitlines():
        document.add(tomlkit.comment(_printable(line)))
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
        written = section.model_dump(mode="json", exclude_defaults=True) if name in QUIET else value
        if written:
            document.add(name, _table(type(section), written, coordinates))
    below = "".join(f"\n# {_printable(line)}".rstrip() if line else "\n#" for line in ending.splitlines())
    return tomlkit.dumps(document) + (f"{below}\n" if below else "")


def _printable(line: str) -> str:
    """Return a line with question marks for control characters, which file names may contain, unlike TOML."""
    return "".join(letter if letter.isprintable() else "?" for letter in line)


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
            table.add(name, _table(section_at(section, [name]), value, coordinates))
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
