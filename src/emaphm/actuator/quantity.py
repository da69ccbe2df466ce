"""A physical quantity as a model field: a description with symbol, unit, source and bounds."""

from typing import Any

from pydantic import Field

COLDEST, HOTTEST = 150.0, 500.0
"""Mean temperatures of an actuator [K] that are not taken for a mistake of units."""

ROTARY_TO_LINEAR = (("kg·m²", "kg"), ("N·m", "N"), ("rad", "m"))


def quantity(description: str, unit: str, source: str, **bounds: Any) -> Any:
    """Return a pydantic field for a quantity in `unit`, as found in `source`; `bounds` as for `Field`."""
    bounds.setdefault("strict", True)  # true and "48" are no quantities
    return Field(
        description=description,
        json_schema_extra={"unit": unit, "source": source},
        **bounds,
    )


def unit_for(unit: str, coordinates: str) -> str:
    """Return the unit of a generalised coordinate: rotary units as they are, or their linear counterparts.

    >>> unit_for("N·m·s/rad", "linear")
    'N·s/m'
    """
    if coordinates == "linear":
        for rotary, linear in ROTARY_TO_LINEAR:
            unit = unit.replace(rotary, linear)
    return unit
