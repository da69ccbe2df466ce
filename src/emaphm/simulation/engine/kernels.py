"""Compiling a model's kernel, and what the kernels of all models share.

A kernel advances `lanes` actuators together and records interval means. Its arguments:

x, p : float64 (rows × lanes,), state and parameters, row by row; x is updated in place
command, load, noise : float64 (samples × substeps,), shared by all lanes
step : integration step [s]
substeps : steps in a sample interval
window : steps at the start of each interval that its mean is taken over
carried : 0 or 1, whether motion is recorded as at the start of a step or as it has led to
out : float64 (channels, samples, lanes), filled with the means

LLVM turns the innermost loop, over lanes, into vector instructions where the number of lanes is known
when compiling, all lanes stand in one flat array, and the loop has neither branches nor calls left. Laws
take scalars for that reason: a function that is handed `x` or `p` itself makes the kernels ten times slower
(measured), which is why the kernels repeat how their common rows are read and written.
"""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np

from emaphm.arrays import Array
from emaphm.errors import MethodError
from emaphm.simulation.engine.inputs import Inputs
from emaphm.simulation.engine.plant import Plant
from emaphm.simulation.laws.commutation import wrap
from emaphm.simulation.laws.controller import speed_error
from emaphm.simulation.laws.lag import share_of_step

Kernel = Callable[..., None]

OBSERVABLE = ("current_A", "voltage_V", "position_rad", "speed_rad_s")
"""The first channels of every model: what a rig may record and a fit compare."""

LANES = 16
"""Actuators that a batch kernel advances together: two AVX-512 registers, four of AVX2."""


def _revision() -> int:
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parents[1].rglob("*.py")):
        digest.update(source.read_bytes())
    return int.from_bytes(digest.digest()[:4], "big")


REVISION = _revision()
"""Of the source of all laws, as loaded."""


class Layout(NamedTuple):
    """What a kernel is compiled for."""

    lanes: int
    channels: int
    """How many of the model's channels are recorded, from the first on."""
    revision: int
    """Marks the source of all laws, so that Numba's cache on disk sees when one of them has changed."""


@dataclass(frozen=True)
class Initial:
    """Where a run starts: motor angle [rad], motor speed [rad/s], and the rotor's electrical zero.

    `angle` is gear-wise: user position / gear ratio. The rotor's absolute mechanical angle, which
    commutation and eccentricity depend on, is angle + rotor_offset [rad].
    """

    angle: float = 0.0
    speed: float = 0.0
    rotor_offset: float = 0.0


@dataclass(frozen=True)
class Model:
    """A model of the actuator: how to build its kernel, parameters and initial state.

    `step` is its integration step [s]; `channels` are what a single run records, of which a batch
    records the first, the equivalent current, or those of `OBSERVABLE`; `switches` says that it switches
    the supply, which takes windings.
    """

    name: str
    step: float
    channels: tuple[str, ...]
    switches: bool
    parameters: Callable[[Plant, float], Array]
    initial_state: Callable[[Plant, Inputs, Initial], Array]
    build: Callable[[Layout], Callable[..., None]]


@cache
def kernel(model: Model, lanes: int, channels: int) -> Kernel:
    """Return the kernel of `model`, compiled to record its first `channels`: one, `OBSERVABLE`, or all."""
    # Any stride, so that a constant needs no storage.
    vector = numba.types.Array(numba.float64, 1, "A", readonly=True)
    flat = numba.types.Array(numba.float64, 1, "C")
    cube = numba.types.Array(numba.float64, 3, "C")
    signature = numba.void(
        flat, flat, vector, vector, vector, numba.float64, numba.int64, numba.int64, numba.float64, cube
    )
    options: Any = {"fastmath": True, "error_model": "numpy", "nogil": True, "cache": True}
    compiled: Kernel = numba.njit(signature, **options)(model.build(Layout(lanes, channels, REVISION)))
    return compiled


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
    "hinge",
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
    HINGE,
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
        "hinge": plant.hinge * plant.gear_ratio,
        "viscous": plant.viscous,
        "static": plant.static,
        "coulomb": plant.coulomb,
        "half_gap": plant.backlash / 2,
        "low_stop": plant.low_stop,
        "high_stop": plant.high_stop,
        "step_per_inertia": step / plant.inertia,
        "pole_pairs": plant.pole_pairs,
    }
    return np.stack([rows[name] for name in CONTROL_AND_MOTION])


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
"""Start beyond an end stop [rad at the motor] that is still put down to a sensor."""


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
