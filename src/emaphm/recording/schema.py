"""Schema of a recording's columns: names, units and meanings."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from emaphm.actuator.quantity import USER_ANGLE


@dataclass(frozen=True)
class Channel:
    """Meaning and unit of a column."""

    meaning: str
    unit: str


SCHEMA: Mapping[str, Channel] = MappingProxyType(
    {
        "time_s": Channel("time", "s"),
        "command_rad": Channel("command", USER_ANGLE),
        "position_rad": Channel("position of the user", USER_ANGLE),
        "speed_rad_s": Channel("speed of the motor", "rad/s"),
        "angle_rad": Channel("angle of the motor", "rad"),
        "current_a_A": Channel("current of phase a", "A"),
        "current_b_A": Channel("current of phase b", "A"),
        "current_c_A": Channel("current of phase c", "A"),
        "current_A": Channel("equivalent current", "A"),
        "current_d_A": Channel("current along the rotor's flux", "A"),
        "current_q_A": Channel("current across the rotor's flux", "A"),
        "voltage_V": Channel("line voltage", "V"),
        "voltage_d_V": Channel("voltage along the rotor's flux", "V"),
        "voltage_q_V": Channel("voltage across the rotor's flux", "V"),
        "duty": Channel("share of the supply voltage that the drive applies", "-"),
        "supply_V": Channel("supply voltage", "V"),
        "enabled": Channel("0 where the drive is switched off", "-"),
        "load_Nm": Channel("load at the motor", "N·m"),
        "temperature_K": Channel("temperature", "K"),
    }
)
"""Schema columns in their usual order; for their units in other coordinates see
`emaphm.actuator.quantity.unit_for`."""

SHORT_NAMES: Mapping[str, str] = MappingProxyType(
    {
        "current": "current_A",
        "voltage": "voltage_V",
        "position": "position_rad",
        "speed": "speed_rad_s",
    }
)
"""Columns by the short names that a user may use for them."""

PHASES = ("current_a_A", "current_b_A", "current_c_A")
"""The phase currents; with `angle_rad` they replace a missing `current_A`."""

CURRENTS = (*PHASES, "current_A", "current_d_A", "current_q_A")
"""All currents of the motor."""

RESPONSES = (
    "current_A",
    "current_q_A",
    "current_d_A",
    "voltage_V",
    "voltage_q_V",
    "voltage_d_V",
    "duty",
    "position_rad",
    "speed_rad_s",
)
"""Responses of an actuator to a command: a recording has at least one, to be compared with a model."""
