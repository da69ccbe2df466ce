"""Lumped parameters, which a calibration estimates: sums of motor and user, referred to the motor shaft."""

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from emaphm.actuator.actuator import Actuator, described_parts
from emaphm.actuator.section import SMALLEST
from emaphm.actuator.unit.baseline import HALL_SENSORS, LUMPED_PARAMETERS, PARTS, SIGNED
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
"""Sections, and parameters, of optional laws: they must be described before they can be estimated."""

LIKE_FAULTS = ("coulomb", "static", "backlash", "position_gain", "torque_constant", "resistance")
"""Parameters that faults change: their deviation on a healthy unit is confounded with a fault."""


def check_lumped_parameters(actuator: Actuator, names: Mapping[str, Any] | tuple[str, ...]) -> None:
    """Raise `MethodError` for a name that is unknown or whose section `actuator` lacks."""
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
    """Return the described lumped parameters by name that are not 0 and not `estimated`."""
    values = {name: sum(described_parts(actuator, name) or ()) for name in LUMPED_PARAMETERS}
    return {name: float(value) for name, value in values.items() if value and name not in estimated}


def not_calibrated(actuator: Actuator) -> tuple[str, ...]:
    """Return the parameters of `LIKE_FAULTS` that the calibration of `actuator` has not estimated.

    Parameters with a tolerance are left out, since a diagnosis estimates them. Empty without a calibration.
    """
    if actuator.baseline is None:
        return ()
    not_estimated = kept_parameters(actuator, actuator.uncertain_parameters)
    return tuple(name for name in LIKE_FAULTS if name in not_estimated)


def static_follows(actuator: Actuator, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return `values` with `static` added in its described ratio to `coulomb`, unless it is given."""
    completed = dict(values)
    if "coulomb" in completed and "static" not in completed:
        m = actuator.mechanics
        if m.dynamic_friction > 0:
            completed["static"] = m.static_friction / m.dynamic_friction * np.asarray(completed["coulomb"])
        else:
            completed["static"] = np.maximum(m.static_friction, completed["coulomb"])
    return completed


def with_lumped_parameters(
    actuator: Actuator, values: Mapping[str, float], *, name: str | None = None
) -> Actuator:
    """Return `actuator` with the given lumped parameters, in unchanged shares of motor and user.

    Raises
    ------
    MethodError
        A parameter is unknown, or needs a section that the actuator lacks.
    ActuatorError
        A value is impossible, such as an inertia that is not positive.
    """
    check_lumped_parameters(actuator, values)
    description = actuator.model_dump()
    for parameter, given in static_follows(actuator, values).items():
        section, first, *further = PARTS[parameter]
        # An estimate of either sign may differ from 0 by rounding only, which no description accepts.
        value = 0.0 if parameter in SIGNED and abs(given) < SMALLEST else given
        if section == "ripple":
            description["ripple"][int(first) - 1][further[0]] = float(value)
            continue
        fields = description[section]
        described = fields[first] + sum(fields[field] for field in further)
        for field in (first, *further):
            share = fields[field] / described if described else float(field == first)
            fields[field] = float(value * share)
    if "torque_constant" in values:
        # The drive still assumes the described constant, also if it was given for the motor only.
        description["controller"]["torque_constant"] = actuator.drive_constant
    description["name"] = name or actuator.name
    return Actuator.from_dict(description, where=description["name"])
