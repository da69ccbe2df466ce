"""Pages that are made from the program itself: the keys of a description, and the public names."""

import inspect
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel

import emaphm as ema
from emaphm.actuator.quantity import unit_for


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
            extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
            unit = unit_for(str(extra.get("unit", "")), "rotary")
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
