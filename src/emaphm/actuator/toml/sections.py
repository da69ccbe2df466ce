"""Look-up of the section of a description by its path of keys."""

from pydantic import BaseModel


def section_at(root: type[BaseModel], path: list[str]) -> type[BaseModel]:
    """Return the model of the last section on `path`, keys that start at `root`."""
    section = root
    for part in path:
        if part not in section.model_fields:  # an index of a list, or a name in a mapping
            continue
        annotation = section.model_fields[part].annotation
        candidates = [annotation, *getattr(annotation, "__args__", ())]
        below = [c for c in candidates if isinstance(c, type) and issubclass(c, BaseModel)]
        if not below:  # a value of several parts, such as end_stops
            return section
        section = below[0]
    return section
