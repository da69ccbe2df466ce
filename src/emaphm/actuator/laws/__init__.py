"""The optional laws of an actuator: their catalogue, and why some actuators cannot have one."""

from emaphm.actuator.laws.catalogue import (
    LAWS,
    Law,
    largest_speed,
    law_named,
    laws_of,
    typical_dry_friction,
    typical_speed,
)

__all__ = [
    "LAWS",
    "Law",
    "largest_speed",
    "law_named",
    "laws_of",
    "typical_dry_friction",
    "typical_speed",
]
