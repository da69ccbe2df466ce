"""Lumped parameters: sums over motor and user, referred to the motor shaft, as calibration estimates them."""

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from emaphm.actuator.actuator import Actuator, described_parts
from emaphm.actuator.unit.baseline import HALL_SENSORS, LUMPED_PARAMETERS, PARTS
from emaphm.errors import MethodError, nearest

__all__ = [
    "LUMPED_PARAMETERS",
    "PARTS",
    "check_lumped_parameters",
    "kept_parameters",
    "lumped_parameters",
    "not_calibrated",
    "static_follows",
    "with_lumped_parameters",
]


OPTIONAL = (
    "drive",
    "friction",
    "transmission",
    "weight",
    "ripple",
    "temperature_gain",
    "saturation",
    "flat_loss",
    "sine_share",
    *HALL_SENSORS,
)
"""Sections, and parameters, whose values are laws of their own: one that is not described is not there."""

LIKE_FAULTS = ("coulomb", "static", "backlash", "position_gain", "torque_constant", "resistance")
"""Parameters that the faults change: a healthy unit that differs in one of them seems to have that fault."""


def check_lumped_parameters(actuator: Actuator, names: Mapping[str, Any] | tuple[str, ...]) -> None:
    """Raise `MethodError` for a name that is unknown or that `actuator` has no section for."""
    for name in names:
        if name not in LUMPED_PARAMETERS:
            raise MethodError(f"unknown parameter '{name}'{nearest(name, LUMPED_PARAMETERS)}")
        section = PARTS[name][0]
        if section == "electrical" and actuator.electrical is None:
            raise MethodError(
                f"parameter '{name}' needs an [electrical] section, which actuator '{actuator.name}' lacks; "
                "add one or leave the parameter out"
            )
        if (section in OPTIONAL or name in OPTIONAL) and described_parts(actuator, name) is None:
            key = "[[ripple]]" if section == "ripple" else f"{name} in [{section}]"
            raise MethodError(
                f"parameter '{name}' needs {key}, which actuator '{actuator.name}' lacks; add it, or leave "
                "the parameter out"
            )


def lumped_parameters(actuator: Actuator, names: tuple[str, ...]) -> dict[str, float]:
    """Return the described values of the named parameters, in the units of `LUMPED_PARAMETERS`."""
    check_lumped_parameters(actuator, names)
    return {name: float(sum(described_parts(actuator, name) or ())) for name in names}


def kept_parameters(actuator: Actuator, estimated: Collection[str]) -> dict[str, float]:
    """Return the parameters that are described, other than 0, and not among those `estimated`."""
    values = {name: sum(described_parts(actuator, name) or ()) for name in LUMPED_PARAMETERS}
    return {name: float(one) for name, one in values.items() if one and name not in estimated}


def not_calibrated(actuator: Actuator) -> tuple[str, ...]:
    """Return the parameters `LIKE_FAULTS` that a calibrated actuator has as described; none without one.

    Those with a tolerance are estimated in a diagnosis, and are left out.
    """
    if actuator.baseline is None:
        return ()
    tolerances = actuator.open_tolerances
    known = {*actuator.baseline.names, *(tolerances.names if tolerances else ())}
    kept = kept_parameters(actuator, known)
    return tuple(name for name in LIKE_FAULTS if name in kept)


def static_follows(actuator: Actuator, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return `values` with static friction in its present ratio to `coulomb`, unless it is given itself."""
    following = dict(values)
    if "coulomb" in following and "static" not in following:
        m = actuator.mechanics
        if m.dynamic_friction > 0:
            following["static"] = m.static_friction / m.dynamic_friction * np.asarray(following["coulomb"])
        else:
            following["static"] = np.maximum(m.static_friction, following["coulomb"])
    return following


def with_lumped_parameters(
    actuator: Actuator, values: Mapping[str, float], *, name: str | None = None
) -> Actuator:
    """Return `actuator` with the given parameters, motor and user keeping their shares; renamed if asked.

    Raises
    ------
    MethodError
        A parameter is unknown, or needs a section that the actuator lacks.
    ActuatorError
        A value is impossible, such as an inertia that is not positive.
    """
    check_lumped_parameters(actuator, values)
    description = actuator.model_dump()
    for parameter, value in static_follows(actuator, values).items():
        section, first, *others = PARTS[parameter]
        if section == "ripple":
            description["ripple"][int(first) - 1][others[0]] = float(value)
            continue
        fields = description[section]
        present = fields[first] + sum(fields[field] for field in others)
        for field in (first, *others):
            share = fields[field] / present if present else float(field == first)
            fields[field] = float(value * share)
    if "torque_constant" in values:
        # What the drive assumes is not the motor's any more, where that stood for it.
        description["controller"]["torque_constant"] = actuator.drive_constant
    description["name"] = name or actuator.name
    return Actuator.from_dict(description, where=description["name"])
