"""Motion of the shaft: from torque to speed, angle and the user's side of the gap."""

from typing import Any

from emaphm.simulation.laws.backlash import follow
from emaphm.simulation.laws.controller import clip
from emaphm.simulation.laws.friction import speed_after
from emaphm.simulation.laws.inline import law, select


@law
def move(
    speed: Any,
    angle: Any,
    output: Any,
    torque: Any,
    viscous: Any,
    static: Any,
    dynamic: Any,
    half_gap: Any,
    low_stop: Any,
    high_stop: Any,
    step: Any,
    step_per_inertia: Any,
) -> Any:
    """Return speed [rad/s], motor angle [rad] and user-side angle [rad] after `step` [s].

    `torque` [N·m] is the motor's less the load. The speed is updated first, the angle with the new
    speed, then the backlash. The stops hold the user's side: an angle that would pass one by more than
    the gap ends there at speed 0, for as long as the torque pushes outward.
    """
    free = speed_after(speed, torque - viscous * speed, static, dynamic, step_per_inertia)
    reached = angle + free * step
    held = clip(reached, low_stop - half_gap, high_stop + half_gap)
    return select(held == reached, free, 0.0), held, follow(output, held, half_gap)


@law
def turn(cos: Any, sin: Any, angle: Any) -> Any:
    """Return (cos, sin) turned by a small `angle` [rad]; the error is angle⁶ / 720 a step."""
    square = angle * angle
    by_cos = 1.0 - square * (0.5 - square * (1 / 24))
    by_sin = angle * (1.0 - square * (1 / 6 - square * (1 / 120)))
    return cos * by_cos - sin * by_sin, sin * by_cos + cos * by_sin
