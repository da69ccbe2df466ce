"""Notes on a unit whose description is unlike those of the other units of its part number."""

import tomllib
from collections.abc import Sequence
from functools import lru_cache

import sqlalchemy as sa

from emaphm.actuator import Actuator
from emaphm.actuator.lumped_parameters import kept_parameters
from emaphm.actuator.unit.baseline import LUMPED_PARAMETERS, SIGNED
from emaphm.history import reading

FACTOR = 2.0
"""Ratio to the nearest of the other units from which on a parameter is noted.

Data sheets state tolerances of some tens of percent; another type of actuator differs by more, in several.
"""

MOST_COMPARED = 20
"""Other units that a unit is compared with: enough to show what is usual, and as quick in any fleet."""

MOST_NAMED = 4
"""Parameters that a note names."""


def description_notes(connection: sa.Connection, unit: reading.UnitRow) -> tuple[str, ...]:
    """Return a note where the description of a unit's last diagnosis is unlike those of other units, or none.

    A description of another actuator under the right part number gives diagnoses that look like others.
    """
    toml = reading.description(connection, unit.id)
    others = reading.other_descriptions(connection, unit, MOST_COMPARED)
    return () if toml is None else unlike_others(toml, others)


def unlike_others(toml: str, others: Sequence[str]) -> tuple[str, ...]:
    """Return a note on a description (TOML) that is unlike those of `others`, or none.

    Compared are the parameters that cannot be below 0, where this unit and another have them.
    """
    distinct = {one for one in others if one != toml}
    if not distinct or toml in others:
        return ()
    own, known = _parameters(toml), [_parameters(one) for one in distinct]
    found = []
    for name, value in own.items():
        values = [one[name] for one in known if name in one]
        if values and not min(values) / FACTOR <= value <= max(values) * FACTOR:
            unit = LUMPED_PARAMETERS[name].replace("-", "")
            found.append(f"{name} {value:.3g} instead of {_range(values)} {unit}".rstrip())
    if not found:
        return ()
    more = f", and {len(found) - MOST_NAMED} more" if len(found) > MOST_NAMED else ""
    note = (
        "its description is unlike those of other units of the part number: "
        f"{', '.join(found[:MOST_NAMED])}{more}; check whose description that is (--actuator); if it is "
        "another actuator's, 'emaphm history withdraw' takes the recordings out"
    )
    return (note,)


@lru_cache(maxsize=256)
def _parameters(toml: str) -> dict[str, float]:
    actuator = Actuator.from_dict(tomllib.loads(toml), where="a description kept in the history")
    return {name: value for name, value in kept_parameters(actuator, SIGNED).items() if value > 0}


def _range(values: Sequence[float]) -> str:
    low, high = f"{min(values):.3g}", f"{max(values):.3g}"
    return low if low == high else f"{low} to {high}"
