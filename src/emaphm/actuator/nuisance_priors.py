"""`[nuisances]`: prior standard deviations of the nuisances, unknowns of a recording that are no faults."""

from typing import Any, Literal

from pydantic import Field

from emaphm.actuator.quantity import USER_ANGLE, quantity
from emaphm.actuator.section import Section

PRIOR = "chosen: what may be expected of a rig"

NuisanceName = Literal[
    "load",
    "hinge",
    "load_variation",
    "temperature",
    "supply",
    "inertia",
    "current_offset",
    "current_scale",
    "delay",
    "current_drift",
    "current_delay",
    "voltage_offset",
    "voltage_scale",
    "voltage_drift",
    "voltage_delay",
    "position_offset",
    "position_scale",
    "position_drift",
    "position_delay",
    "speed_offset",
    "speed_scale",
    "speed_drift",
    "speed_delay",
]


def _sensor_zero(meaning: str, unit: str) -> Any:
    usual = "0.2 % of the range that the actuator's limits imply where left out"
    return quantity(f"{meaning}; {usual}", unit, PRIOR, default=None, gt=0)


def _sensor_scale(sensors: str) -> Any:
    return quantity(f"scale of the {sensors}, relative", "-", PRIOR, default=0.01, gt=0)


def _sensor_delay(sensors: str) -> Any:
    meaning = f"delay of {sensors} against the command, of either sign"
    return quantity(meaning, "s", PRIOR, default=2e-4, gt=0)


class Nuisances(Section):
    """Prior standard deviations of the nuisances about the description.

    The nuisances in `estimated` are estimated with the faults unless a diagnosis names others.
    """

    estimated: tuple[NuisanceName, ...] = Field(
        default=("load", "temperature"), description="estimated with the faults by default", strict=False
    )
    load: float | None = quantity(
        "constant load at the motor; 6 % of the motor's torque at its current limit where left out",
        "N·m",
        PRIOR,
        default=None,
        gt=0,
    )
    hinge: float | None = quantity(
        "load stiffness: load at the motor per position of the user; the motor's torque at its current limit "
        "over the farther end stop where left out",
        f"N·m/{USER_ANGLE}",
        PRIOR,
        default=None,
        gt=0,
    )
    load_variation: float | None = quantity(
        "load at the motor that varies over the recording: each coefficient of its spline; as of a constant "
        "one where left out",
        "N·m",
        PRIOR,
        default=None,
        gt=0,
    )
    temperature: float = quantity("winding and magnets, above nominal", "K", PRIOR, default=30.0, gt=0)
    supply: float = quantity("supply voltage, relative", "-", PRIOR, default=0.05, gt=0)
    inertia: float = quantity("inertia, relative", "-", PRIOR, default=0.05, gt=0)
    current_offset: float | None = quantity(
        "zero of the current sensors; 0.2 % of the current limit where left out",
        "A",
        PRIOR,
        default=None,
        gt=0,
    )
    current_scale: float = _sensor_scale("current sensors")
    delay: float = _sensor_delay("all sensed channels")
    current_drift: float | None = _sensor_zero("change of the current sensors' zero over the recording", "A")
    current_delay: float = _sensor_delay("the currents alone")
    voltage_offset: float | None = _sensor_zero("zero of the voltage sensor", "V")
    voltage_scale: float = _sensor_scale("voltage sensor")
    voltage_drift: float | None = _sensor_zero("change of the voltage sensor's zero over the recording", "V")
    voltage_delay: float = _sensor_delay("the voltage alone")
    position_offset: float | None = _sensor_zero("zero of the position sensor", USER_ANGLE)
    position_scale: float = _sensor_scale("position sensor")
    position_drift: float | None = _sensor_zero(
        "change of the position sensor's zero over the recording", USER_ANGLE
    )
    position_delay: float = _sensor_delay("the position alone")
    speed_offset: float | None = _sensor_zero("zero of the speed sensor", "rad/s")
    speed_scale: float = _sensor_scale("speed sensor")
    speed_drift: float | None = _sensor_zero("change of the speed sensor's zero over the recording", "rad/s")
    speed_delay: float = _sensor_delay("the speed alone")
