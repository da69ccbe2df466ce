"""Physical quantities as model fields, with meaning, symbol, unit, source and bounds; conversion of units."""

from typing import Any, Literal

from pydantic import Field

THESIS, CHOSEN = "thesis Tab. 3.1", "chosen, not in the thesis"
"""Sources of most quantities."""

COLDEST, HOTTEST = 150.0, 500.0
"""Range of the mean temperature of an actuator [K]; values outside it are taken for a wrong unit."""

Coordinates = Literal["rotary", "linear", "screw"]
"""Units of the positions of motor and user: both in rad, both in m, or the motor in rad and the user in m."""

USER_ANGLE, ELECTRICAL_ANGLE = "rad (user)", "rad (electrical)"
"""Units of the user's position, a length behind a screw, and of electrical angles, which are always in
rad."""

ROTARY_TO_LINEAR = (("kg·m²", "kg"), ("N·m", "N"), ("rad", "m"))

SIMPLER = {"rad/rad": "-", "m/m": "-", "rad/(s·rad)": "1/s", "m/(s·m)": "1/s"}


def quantity(description: str, unit: str, source: str, **bounds: Any) -> Any:
    """Return a pydantic field for a quantity in `unit` from `source`, with `bounds` as for `Field`."""
    # The description is written into TOML files, whose hash identifies an actuator in a history.
    bounds.setdefault("strict", True)  # true and "48" are no quantities
    return Field(
        description=description,
        json_schema_extra={"unit": unit, "source": source},
        **bounds,
    )


def unit_for(unit: str, coordinates: str) -> str:
    """Return the unit of a quantity in these coordinates, from its rotary unit.

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
