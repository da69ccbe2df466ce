"""The rows of state and parameters that the kernels of all models share, and where a run starts."""

import numpy as np

from emaphm.arrays import Array
from emaphm.errors import MethodError
from emaphm.simulation.engine.inputs import Inputs
from emaphm.simulation.engine.model import Initial
from emaphm.simulation.engine.plant import Plant
from emaphm.simulation.laws.angles import wrap
from emaphm.simulation.laws.lag import share_of_step
from emaphm.simulation.laws.position_loop import speed_error

CONTROL_AND_MOTION = (
    "position_gain",
    "speed_limit",
    "proportional",
    "integrating",
    "derivative",
    "current_limit",
    "feedback_share",
    "torque_share",
    "gear_ratio",
    "torque_limit",
    "offset",
    "load_stiffness",
    "viscous",
    "static",
    "coulomb",
    "half_gap",
    "low_stop",
    "high_stop",
    "step_per_inertia",
    "pole_pairs",
)
"""The first parameter rows of every model, in this order."""

(
    POSITION_GAIN,
    SPEED_LIMIT,
    PROPORTIONAL,
    INTEGRATING,
    DERIVATIVE,
    CURRENT_LIMIT,
    FEEDBACK_SHARE,
    TORQUE_SHARE,
    GEAR_RATIO,
    TORQUE_LIMIT,
    OFFSET,
    LOAD_STIFFNESS,
    VISCOUS,
    STATIC,
    COULOMB,
    HALF_GAP,
    LOW_STOP,
    HIGH_STOP,
    STEP_PER_INERTIA,
    POLE_PAIRS,
) = range(len(CONTROL_AND_MOTION))


def control_and_motion(plant: Plant, step: float) -> Array:
    """Return the parameter rows `CONTROL_AND_MOTION`, shape (rows, n); gains in A, not N·m."""
    rows = {
        "position_gain": plant.position_gain,
        "speed_limit": plant.speed_limit,
        "proportional": plant.speed_gain / plant.drive_constant,
        "integrating": plant.integral_gain / plant.drive_constant,
        "derivative": plant.derivative_gain / plant.drive_constant / step,
        "current_limit": plant.current_limit,
        "feedback_share": share_of_step(plant.speed_lag, step),
        "torque_share": share_of_step(plant.torque_lag, step),
        "gear_ratio": plant.gear_ratio,
        "torque_limit": plant.torque_limit,
        "offset": plant.offset,
        "load_stiffness": plant.hinge * plant.gear_ratio,
        "viscous": plant.viscous,
        "static": plant.static,
        "coulomb": plant.coulomb,
        "half_gap": plant.backlash / 2,
        "low_stop": plant.low_stop,
        "high_stop": plant.high_stop,
        "step_per_inertia": step / plant.inertia,
        "pole_pairs": plant.pole_pairs,
    }
    return np.array([rows[name] for name in CONTROL_AND_MOTION])


(
    SPEED,
    FEEDBACK,
    TORQUE,
    ANGLE,
    OUTPUT,
    ELECTRICAL,
    COS,
    SIN,
    INTEGRAL,
    ERROR,
    CURRENT,
) = range(11)
"""The first state rows of every model; the currents follow from CURRENT on."""


BEYOND_STOP = 0.1
"""Start beyond an end stop [rad at the motor] that is still attributed to a sensor."""


def moving_state(plant: Plant, inputs: Inputs, start: Initial, currents: int) -> Array:
    """Return state rows for motion and control at `start` and `currents` rows of zero, shape (rows, n)."""
    x = np.zeros((CURRENT + currents, plant.count))
    beyond = np.maximum(start.angle - plant.high_stop, plant.low_stop - start.angle) - plant.backlash / 2
    if np.any(beyond > BEYOND_STOP):
        raise MethodError(
            f"the run starts at {start.angle * plant.gear_ratio[0]:.4g}, beyond the actuator's end stops; "
            "correct end_stops or the position"
        )
    rotor = start.angle + start.rotor_offset
    x[SPEED] = x[FEEDBACK] = start.speed
    x[ANGLE] = x[OUTPUT] = start.angle
    x[ELECTRICAL] = wrap(plant.pole_pairs * rotor)
    x[COS], x[SIN] = np.cos(rotor), np.sin(rotor)
    x[ERROR] = speed_error(
        inputs.command[0], plant.gear_ratio * start.angle, start.speed, plant.position_gain, plant.speed_limit
    )
    return x
