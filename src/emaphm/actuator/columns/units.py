"""Conversion of recorded columns into the SI unit of their channel by pint.

pint is imported only when a unit is converted, because the import takes longer than reading a recording.
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
    "min^-1": "rpm",
    "r/min": "rpm",
    "U/min": "rpm",
    "RPM": "rpm",
    "r/s": "rps",
    "µ": "u",
    "·": "*",
    "²": "**2",
}
"""Spellings of units and their signs that pint does not read, or reads otherwise, with pint's spelling.
1/min, r/min (ISO 80000-3) and U/min mean turns per minute."""

LONGEST = 40
"""Longest unit [characters]."""

COMMON = (
    "s", "ms", "us", "min", "rad", "mrad", "deg", "turn", "m", "mm", "um", "in", "rad/s", "deg/s", "rpm",
    "m/s", "mm/s", "A", "mA", "V", "mV", "kV", "N", "kN", "kgf", "lbf", "N*m", "mN*m", "kgf*m", "lbf*in", "K",
    "degC", "degF", "percent", "dimensionless",
)  # fmt: skip
"""Units that are proposed for a mistyped unit; pint supports many more."""


def check_unit(unit: str) -> None:
    """Raise `ValueError` if `unit` is not a unit; the message names the nearest unit."""
    try:
        if len(unit) > LONGEST:
            raise ValueError(unit)  # noqa: TRY301 - the same as any other text that is no unit
        _registry().parse_units(_pint_spelling(unit))
    except Exception:  # noqa: BLE001 - pint's parser raises many kinds of errors on other texts
        raise ValueError(f"unknown unit '{unit[:LONGEST]}'{nearest(unit[:LONGEST], COMMON)}") from None


def in_unit(values: Array, unit: str, target: str) -> Array:
    """Return `values` (n,), given in `unit`, converted into the unit `target`.

    An angle is not a dimensionless number here: rad and deg are converted into each other, but percent or Hz
    are not converted into rad or rad/s.

    Raises
    ------
    ValueError
        The units are of different quantities.
    """
    import pint

    registry = _registry()
    from_unit, to_unit = (registry.parse_units(_pint_spelling(text)) for text in (unit, target))
    if registry.get_base_units(from_unit)[1] != registry.get_base_units(to_unit)[1]:
        raise ValueError(f"{unit} does not convert into {target}")
    try:
        converted: Any = registry.convert(values, from_unit, to_unit)
    except pint.errors.PintError:
        raise ValueError(f"{unit} does not convert into {target}") from None
    return converted  # type: ignore[no-any-return]


def _pint_spelling(unit: str) -> str:
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
    # Common in data sheets for speeds and torques, but unknown to pint.
    registry.define("@alias turn = rev")
    registry.define("newton_meter = newton * meter = Nm")
    registry.define("newton_centimeter = newton * centimeter = Ncm")
    return registry
