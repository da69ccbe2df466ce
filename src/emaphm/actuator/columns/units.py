"""Units of recorded columns, converted into the SI unit of their channel by pint.

pint is imported when a unit is asked for, and not before: it takes longer than reading a recording.
"""

from functools import cache
from typing import TYPE_CHECKING, Any

from emaphm.arrays import Array
from emaphm.errors import nearest

if TYPE_CHECKING:
    import pint

ALIASES = {
    "°": "deg",
    "°C": "degC",
    "-": "dimensionless",
    "": "dimensionless",
    "1/min": "rpm",
    "min⁻¹": "rpm",
    "µ": "u",
    "·": "*",
    "²": "**2",
}
"""Units, and signs of them, that are written otherwise than pint reads them. Turns are what is per minute."""

LONGEST = 40
"""Longest unit [characters]."""

COMMON = (
    "s", "ms", "us", "min", "rad", "mrad", "deg", "turn", "m", "mm", "um", "in", "rad/s", "deg/s", "rpm",
    "m/s", "mm/s", "A", "mA", "V", "mV", "kV", "N", "kN", "kgf", "lbf", "N*m", "mN*m", "kgf*m", "lbf*in", "K",
    "degC", "degF", "percent", "dimensionless",
)  # fmt: skip
"""Units that a mistyped one is compared with; pint knows many more."""


def check_unit(unit: str) -> None:
    """Raise `ValueError` where `unit` is none; the message names the nearest one."""
    try:
        if len(unit) > LONGEST:
            raise ValueError(unit)  # noqa: TRY301 - as any other text that is no unit
        _registry().parse_units(_spelt(unit))
    except Exception:  # noqa: BLE001 - pint's parser fails in many ways on what is no unit
        raise ValueError(f"unknown unit '{unit[:LONGEST]}'{nearest(unit[:LONGEST], COMMON)}") from None


def in_unit(values: Array, unit: str, target: str) -> Array:
    """Return `values` (n,), which stand in `unit`, in the unit `target`.

    An angle is no bare number here: rad and deg convert into each other, not percent or Hz into rad or rad/s.

    Raises
    ------
    ValueError
        The one unit is of another quantity than the other.
    """
    import pint

    registry = _registry()
    given, wanted = (registry.parse_units(_spelt(one)) for one in (unit, target))
    if registry.get_base_units(given)[1] != registry.get_base_units(wanted)[1]:
        raise ValueError(f"{unit} does not convert into {target}")
    try:
        converted: Any = registry.convert(values, given, wanted)
    except pint.errors.PintError:
        raise ValueError(f"{unit} does not convert into {target}") from None
    return converted  # type: ignore[no-any-return]


def _spelt(unit: str) -> str:
    for written, read in ALIASES.items():
        if unit.strip() == written:
            return read
    for written in ("µ", "·", "²"):
        unit = unit.replace(written, ALIASES[written])
    return unit


@cache
def _registry() -> "pint.UnitRegistry[Any]":
    import pint

    registry: pint.UnitRegistry[Any] = pint.UnitRegistry()
    # How data sheets write torque; pint takes it for no unit.
    registry.define("newton_meter = newton * meter = Nm")
    registry.define("newton_centimeter = newton * centimeter = Ncm")
    return registry
