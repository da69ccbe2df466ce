"""Dry friction after Borello: one speed update that sticks, breaks away and stops exactly (thesis 4.2)."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.inline import law, select


@law
def speed_after(speed: Any, active: Any, static: Any, dynamic: Any, step_per_inertia: Any) -> Any:
    """Return the speed [rad/s] after a step under the torque `active` [N·m] and dry friction.

    Standing still, friction balances `active` up to `static` [N·m] and breaks away against `dynamic`;
    moving, it is `dynamic` against the motion. A step in which the speed would change sign ends at 0,
    so that the next one decides afresh whether it sticks. `step_per_inertia` = dt / J [s/(kg·m²)].
    """
    still = speed == 0.0
    against = np.copysign(dynamic, select(still, active, speed))
    friction = select(still & (np.abs(active) <= static), active, against)
    following = speed + (active - friction) * step_per_inertia
    return select(speed * following < 0.0, 0.0, following)
