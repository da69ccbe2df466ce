"""Conversion of values for JSON, which has no numbers that are not finite."""

import math
from typing import Any


def finite(value: Any) -> Any:
    """Return a JSON value with null for numbers that are not finite; tuples become lists."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    return value
