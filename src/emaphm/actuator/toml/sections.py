"""The sections of a description, by the path of keys that leads to them."""

from pydantic import BaseModel


def section_at(root: type[BaseModel], path: list[str]) -> type[BaseModel]:
    """Return the model that describes what stands at `path` below `root`: the last section on the way."""
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
