"""A physical quantity as a model field: a description with symbol, unit, source and bounds."""

from typing import Any, Literal

from pydantic import Field

THESIS, CHOSEN = "thesis Tab. 3.1", "chosen, not in the thesis"
"""Sources of most quantities."""

COLDEST, HOTTEST = 150.0, 500.0
"""Mean temperatures of an actuator [K] that are not taken for a mistake of units."""

Coordinates = Literal["rotary", "linear", "screw"]
"""What motor and user move in: both in rad, both in m, or the motor in rad and the user in m."""

USER_ANGLE, ELECTRICAL_ANGLE = "rad (user)", "rad (electrical)"
"""Units of the user's position, which is a length behind a screw, and of what stays an angle everywhere."""

ROTARY_TO_LINEAR = (("kg·m²", "kg"), ("N·m", "N"), ("rad", "m"))

SIMPLER = {"rad/rad": "-", "m/m": "-", "rad/(s·rad)": "1/s", "m/(s·m)": "1/s"}


def quantity(description: str, unit: str, source: str, **bounds: Any) -> Any:
    """Return a pydantic field for a quantity in `unit`, as found in `source`; `bounds` as for `Field`."""
    bounds.setdefault("strict", True)  # true and "48" are no quantities
    return Field(
        description=description,
        json_schema_extra={"unit": unit, "source": source},
        **bounds,
    )


def unit_for(unit: str, coordinates: str) -> str:
    """Return a described unit in these coordinates: rotary units as they are, or their linear counterparts.

    >>> unit_for("N·m·s/rad", "linear")
    'N·s/m'
    >>> unit_for("rad (user)/rad", "screw")
    'm/rad'
    """
    if unit == ELECTRICAL_ANGLE:
        return "rad"
    if coordinates == "linear":
        for rotary, linear in ROTARY_TO_LINEAR:
            unit = unit.replace(rotary, linear)
        unit = unit.replace("m (user)", "m")
    unit = unit.replace(USER_ANGLE, "m" if coordinates == "screw" else "rad")
    return SIMPLER.get(unit, unit)
