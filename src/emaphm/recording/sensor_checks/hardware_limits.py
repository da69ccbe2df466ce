"""Levels at which the hardware limits a signal, which are no sensor fault."""

from emaphm.actuator import Actuator

NEAR = 0.03
"""Largest distance between a level and a limit, relative to the limit, at which the level is that limit."""

NEAR_STOP = 0.01
"""The same distance for an end stop, relative to the travel."""

NEAR_SUPPLY = 0.8
"""Share of the described supply from which a voltage may be the full supply: a source may give less than
described."""


def is_hardware_limit(level: float, channel: str, actuator: Actuator) -> bool:
    """Return whether `level` of a channel may be a limit of the hardware of `actuator`."""
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
    """Return whether `position` of the user [rad; m if linear] is at an end stop."""
    stops = actuator.mechanics.end_stops
    if stops is None:
        return False
    return any(abs(position - stop) < NEAR_STOP * (stops[1] - stops[0]) for stop in stops)
