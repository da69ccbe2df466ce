"""Note on a unit whose description differs from those of the other units of its part number."""

import tomllib
from collections.abc import Sequence
from functools import lru_cache

import sqlalchemy as sa

from emaphm.actuator import Actuator
from emaphm.actuator.lumped_parameters import kept_parameters
from emaphm.actuator.unit.baseline import LUMPED_PARAMETERS, SIGNED
from emaphm.errors import ActuatorError
from emaphm.history import reading

FACTOR = 2.0
"""Ratio of a parameter to the nearest of the other units from which on there is a note.

Data sheets state tolerances of some tens of percent; another type of actuator differs by more, in several
parameters.
"""

MOST_COMPARED = 20
"""Largest number of other units for the comparison: enough for the usual range, and quick for any fleet."""

MOST_NAMED = 4
"""Largest number of parameters that a note names."""


def description_notes(connection: sa.Connection, unit: reading.UnitRow) -> tuple[str, ...]:
    """Return a note if the description of a unit's last diagnosis differs from those of other units, or none.

    Diagnoses with the description of another actuator under the right part number look plausible.
    """
    toml = reading.description(connection, unit.id)
    others = reading.other_descriptions(connection, unit, MOST_COMPARED)
    return () if toml is None else unlike_others(toml, others)


def unlike_others(toml: str, others: Sequence[str]) -> tuple[str, ...]:
    """Return a note if a description (TOML) differs from those of `others`, or none.

    The comparison uses the nonnegative parameters that this unit and another unit have. Descriptions that
    this version cannot read, such as those of a newer version, are not compared.
    """
    distinct = {other for other in others if other != toml}
    if not distinct or toml in others:
        return ()
    own, known = _parameters(toml), [_parameters(other) for other in distinct]
    differences = []
    for name, value in own.items():
        values = [parameters[name] for parameters in known if name in parameters]
        if values and not min(values) / FACTOR <= value <= max(values) * FACTOR:
            unit = LUMPED_PARAMETERS[name].replace("-", "")
            differences.append(f"{name} {value:.3g} instead of {_range(values)} {unit}".rstrip())
    if not differences:
        return ()
    more = f", and {len(differences) - MOST_NAMED} more" if len(differences) > MOST_NAMED else ""
    note = (
        "its description differs from those of other units of the part number: "
        f"{', '.join(differences[:MOST_NAMED])}{more}; check the description (--actuator); if it is that of "
        "another actuator, withdraw the recordings with 'emaphm history withdraw'"
    )
    return (note,)


@lru_cache(maxsize=256)
def _parameters(toml: str) -> dict[str, float]:
    """Return the parameters of a description by name, none if this version cannot read it."""
    try:
        actuator = Actuator.from_dict(tomllib.loads(toml))
    except ActuatorError:
        return {}
    return {name: value for name, value in kept_parameters(actuator, SIGNED).items() if value > 0}


def _range(values: Sequence[float]) -> str:
    low, high = f"{min(values):.3g}", f"{max(values):.3g}"
    return low if low == high else f"{low} to {high}"
