"""Levels at which the hardware itself holds a signal: no fault of its sensor."""

from emaphm.actuator import Actuator

NEAR = 0.03
"""Distance from a limit, of the limit, within which a value is held there."""

NEAR_STOP = 0.01
"""The same of an end stop, of the travel."""

NEAR_SUPPLY = 0.8
"""Share of the supply from which on a voltage is all that there is: a source may give less than described."""


def is_hardware_limit(level: float, channel: str, actuator: Actuator) -> bool:
    """Return whether the hardware of `actuator` may itself hold a channel at `level`."""
    controller, electrical = actuator.controller, actuator.electrical
    if channel == "position_rad":
        return _is_end_stop(level, actuator)
    if channel == "angle_rad":
        return _is_end_stop(level * actuator.mechanics.gear_ratio, actuator)
    limits = {
        "speed_rad_s": [controller.speed_limit] if controller.speed_limit else [],
        "duty": [1.0],
        "supply_V": [abs(level)],
    }.get(channel, [])
    if channel.startswith("current"):
        limits = [controller.current_limit]
    if channel.startswith("voltage") and electrical is not None:
        return abs(level) > NEAR_SUPPLY * electrical.supply
    return any(abs(abs(level) / limit - 1) < NEAR for limit in limits if limit > 0)


def _is_end_stop(position: float, actuator: Actuator) -> bool:
    """Return whether the user may stand at `position` [rad; m if linear] because a stop holds it."""
    stops = actuator.mechanics.end_stops
    if stops is None:
        return False
    return any(abs(position - stop) < NEAR_STOP * (stops[1] - stops[0]) for stop in stops)
