"""Pages that are made from the program itself: the keys of a description, and the JSON of the commands."""

import inspect
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel

import emaphm as ema

ANSWERS = {
    "diagnose": "emaphm diagnose flight.csv --actuator unit.toml --json",
    "calibrate": "emaphm calibrate monday.csv --actuator rig.toml --free viscous -o calibrated.toml --json",
    "replay": "emaphm replay flight.csv --actuator unit.toml --json",
    "limits": "emaphm limits --actuator unit.toml --json",
    "prognose": "emaphm prognose --unit SN-0042 --json",
    "history show": "emaphm history show --unit SN-0042 --json",
}
"""Commands whose keys are listed."""


def write_toml_keys(path: Path) -> None:
    """Write the keys of an actuator's TOML, section by section, and the JSON schema next to them."""
    schema = path.with_name("actuator.schema.json")
    schema.write_text(json.dumps(ema.Actuator.model_json_schema(), indent=1), encoding="utf-8")
    lines = [
        "# Keys of a description",
        "",
        "A description of an actuator is a TOML file. `emaphm init rig.toml` writes a first one. Units are",
        "those of a rotary actuator; a linear one has m and N in place of rad and N·m.",
        f"The same as a JSON schema: {{download}}`{schema.name}`.",
        "",
        *_section(ema.Actuator, ""),
    ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _section(model: type[BaseModel], place: str) -> Iterator[str]:
    fields = {name: field for name, field in model.model_fields.items() if not _models(field.annotation)}
    if fields:
        yield from (f"## `[{place}]`" if place else "## At the top", "")
        if place:
            yield from (_first_sentence(model.__doc__ or ""), "")
        yield from ("| key | unit | meaning | default |", "| --- | --- | --- | --- |")
        for name, field in fields.items():
            extra = field.json_schema_extra
            unit = str(extra["unit"]) if isinstance(extra, dict) and "unit" in extra else ""
            default = "needed" if field.is_required() else f"`{field.get_default(call_default_factory=True)}`"
            yield f"| `{name}` | {unit} | {field.description or ''} | {default} |"
        yield ""
    for name, field in model.model_fields.items():
        for below in _models(field.annotation):
            yield from _section(below, f"{place}.{name}" if place else name)


def _models(annotation: Any) -> list[type[BaseModel]]:
    """Return the sections that a field holds."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in get_args(annotation) for model in _models(part)]


def _first_sentence(text: str) -> str:
    return " ".join(text.split("\n\n", maxsplit=1)[0].split())


def write_python_names(path: Path) -> None:
    """Write a page with the public names of the package, each as its docstring explains it."""
    lines = ["# Python", "", "`import emaphm as ema` gives these names.", "", "```{eval-rst}"]
    for name in ema.__all__:
        if not name.startswith("_"):
            kind = "autoclass" if inspect.isclass(getattr(ema, name)) else "autofunction"
            members = ["   :members:"] if kind == "autoclass" else []
            lines += [f".. {kind}:: emaphm.{name}", *members, ""]
    path.write_text("\n".join([*lines, "```", ""]), encoding="utf-8")


def write_json_keys(path: Path, answer: Any) -> None:
    """Write the keys of what the commands print with --json; `answer` runs one and returns the text."""
    lines = [
        "# JSON of the commands",
        "",
        "Made with this page, from what each command printed. Later versions add keys, and rename none.",
        "A number that is not finite is null. [Nomenclature](../../nomenclature.md) explains the terms.",
        "",
    ]
    for name, command in ANSWERS.items():
        lines += [f"## `{name}`", "", f"`{command}`", "", "| key | type |", "| --- | --- |"]
        lines += [f"| `{key}` | {kind} |" for key, kind in _keys(json.loads(answer(command)), "")]
        lines.append("")
    path.write_text("\n".join(lines), encoding="utf-8")


def _keys(value: Any, place: str) -> Iterator[tuple[str, str]]:
    if isinstance(value, dict) and value:
        for name, below in value.items():
            yield from _keys(below, f"{place}.{name}" if place else name)
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        yield from _keys(value[0], f"{place}[]")
    else:
        yield place, _kind(value)


def _kind(value: Any) -> str:
    if isinstance(value, list):
        return f"list of {_kind(value[0])}" if value else "list"
    names = {bool: "true or false", int: "number", float: "number", str: "text", dict: "object"}
    return "null" if value is None else names[type(value)]
