"""One-line messages on errors in a description."""

from pydantic import BaseModel, ValidationError

from emaphm.actuator.toml.sections import section_at
from emaphm.errors import nearest

LONGEST_QUOTED = 200
"""Longest value that a message quotes [characters]; a matrix would hide the message."""

BY_PARAMETER = frozenset({"faults", "nuisances", "tolerances", "baseline", "model_error", "requirements"})
"""Sections whose keys are names of parameters: they are not proposed for a misplaced key."""


def validation_message(error: ValidationError, root: type[BaseModel]) -> str:
    """Return the first of pydantic's errors as one line: the key, the error and the remedy."""
    # A misspelt key also counts as a missing key: the misspelling is reported, which must be corrected.
    first, *further = sorted(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
    path = [str(part) for part in first["loc"]]
    key = ".".join(path) or "description"
    more = f" (and {len(further)} more)" if further else ""
    if first["type"] == "extra_forbidden":
        known = section_at(root, path[:-1]).model_fields
        return f"unknown key '{key}'{_misplaced(root, path) or nearest(path[-1], known)}{more}"
    if first["type"] == "missing":
        field = section_at(root, path[:-1]).model_fields.get(path[-1])
        meaning = f" ({field.description})" if field and field.description else ""
        return f"key '{key}' is missing{meaning}; add it{more}"
    reason = first["msg"].removeprefix("Value error, ").removeprefix("Input ")
    if not path and first["type"] == "value_error":  # an error of several sections, which names its key
        return reason + more
    given = repr(first["input"])
    got = "" if isinstance(first["input"], dict) or len(given) > LONGEST_QUOTED else f", got {given}"
    return f"'{key}': {reason}{got}{more}"


def _misplaced(root: type[BaseModel], path: list[str]) -> str:
    """Return a hint in parentheses if the last key of `path` belongs to another section of `root`."""
    *section, name = path
    if len(section) > 1 or BY_PARAMETER.intersection(section):
        return ""
    if section and name in root.model_fields and section_at(root, [name]) is root:
        return f" ('{name}' stands above all sections; move it there)"
    places = [
        f"[{field}]"
        for field in root.model_fields
        if field not in BY_PARAMETER
        and (below := section_at(root, [field])) is not root
        and name in below.model_fields
    ]
    return f" ('{name}' is a key of {' and of '.join(places)}; move it there)" if places else ""
