"""Position loop around a speed loop, as thesis 3.1.2."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.inline import law


@law
def clip(value: Any, low: Any, high: Any) -> Any:
    """Return `value` limited to [low, high]."""
    return np.minimum(np.maximum(value, low), high)


@law
def speed_error(command: Any, position: Any, measured: Any, gain: Any, limit: Any) -> Any:
    """Return the speed demand less the measured speed [rad/s].

    The demand is gain [1/s] × (command - position) [rad, at the user], limited to ± `limit` [rad/s].
    """
    return clip(gain * (command - position), -limit, limit) - measured


@law
def current_demand(
    error: Any, integral: Any, slope: Any, proportional: Any, integrating: Any, derivative: Any, limit: Any
) -> Any:
    """Return the reference current [A]: PID on the speed error, limited to ± `limit` [A].

    `error` [rad/s], its `integral` [rad] and `slope` [rad/s²]; gains in A per unit of each, the drive's
    torque constant already divided out.
    """
    return clip(proportional * error + integrating * integral + derivative * slope, -limit, limit)
