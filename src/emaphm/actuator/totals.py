"""Physical parameters as calibration sees them: totals of motor and user, referred to the motor shaft."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from emaphm.actuator.actuator import Actuator
from emaphm.errors import MethodError, nearest

TOTALS = {
    "inertia": "kg·m²",
    "viscous": "N·m·s/rad",
    "coulomb": "N·m",
    "static": "N·m",
    "offset": "N·m",
    "hinge": "N·m/rad",
    "position_gain": "1/s",
    "speed_gain": "N·m·s/rad",
    "speed_lag": "s",
    "torque_constant": "N·m/A",
    "torque_lag": "s",
    "resistance": "ohm",
    "inductance": "H",
    "supply": "V",
}
"""Names and units: coulomb is dynamic friction, offset a constant load, hinge one per user's position."""

PARTS = {
    "inertia": ("mechanics", "inertia_motor", "inertia_user"),
    "viscous": ("mechanics", "viscous_motor", "viscous_user"),
    "coulomb": ("mechanics", "dynamic_friction_motor", "dynamic_friction_user"),
    "static": ("mechanics", "static_friction_motor", "static_friction_user"),
    "offset": ("mechanics", "offset"),
    "hinge": ("mechanics", "hinge"),
    "position_gain": ("controller", "position_gain"),
    "speed_gain": ("controller", "speed_gain"),
    "speed_lag": ("controller", "speed_lag"),
    "torque_constant": ("motor", "torque_constant"),
    "torque_lag": ("motor", "torque_lag"),
    "resistance": ("electrical", "resistance"),
    "inductance": ("electrical", "inductance"),
    "supply": ("electrical", "supply"),
}
"""Where each total stands in the description: its section, then the fields it is the sum of."""


def check_totals(actuator: Actuator, names: Mapping[str, Any] | tuple[str, ...]) -> None:
    """Raise `MethodError` for a name that is unknown or that `actuator` has no section for."""
    for name in names:
        if name not in TOTALS:
            raise MethodError(f"unknown parameter '{name}'{nearest(name, TOTALS)}")
        if PARTS[name][0] == "electrical" and actuator.electrical is None:
            raise MethodError(
                f"parameter '{name}' needs an [electrical] section, which actuator '{actuator.name}' lacks; "
                "add one or leave the parameter out"
            )


def totals(actuator: Actuator, names: tuple[str, ...]) -> dict[str, float]:
    """Return the present values of the named totals, in the units of `TOTALS`."""
    check_totals(actuator, names)
    values = {}
    for name in names:
        section, *fields = PARTS[name]
        values[name] = float(sum(getattr(getattr(actuator, section), field) for field in fields))
    return values


def static_follows(actuator: Actuator, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return `values` with static friction in its present ratio to `coulomb`, unless it is given itself."""
    following = dict(values)
    if "coulomb" in following and "static" not in following:
        m = actuator.mechanics
        if m.dynamic_friction > 0:
            following["static"] = m.static_friction / m.dynamic_friction * following["coulomb"]
        else:
            following["static"] = np.maximum(m.static_friction, following["coulomb"])
    return following


def with_totals(actuator: Actuator, values: Mapping[str, float], *, name: str | None = None) -> Actuator:
    """Return `actuator` with the given totals, motor and user keeping their shares; renamed if asked.

    Raises
    ------
    MethodError
        A total is unknown, or needs a section that the actuator lacks.
    ActuatorError
        A value is impossible, such as an inertia that is not positive.
    """
    check_totals(actuator, values)
    description = actuator.model_dump()
    for total, value in static_follows(actuator, values).items():
        section, first, *others = PARTS[total]
        fields = description[section]
        present = fields[first] + sum(fields[field] for field in others)
        for field in (first, *others):
            share = fields[field] / present if present else float(field == first)
            fields[field] = float(value * share)
    description["name"] = name or actuator.name
    return Actuator.from_dict(description, where=description["name"])
