"""The reference model: three phases, hysteresis switching, a step a microsecond (thesis 3.1, chapter 4)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from emaphm.simulation.engine.inputs import Inputs
from emaphm.simulation.engine.model import OBSERVABLE, Initial, Layout, Model
from emaphm.simulation.engine.plant import Plant
from emaphm.simulation.engine.rows import (
    ANGLE,
    CONTROL_AND_MOTION,
    COS,
    COULOMB,
    CURRENT,
    CURRENT_LIMIT,
    DERIVATIVE,
    ELECTRICAL,
    ERROR,
    FEEDBACK,
    FEEDBACK_SHARE,
    GEAR_RATIO,
    HALF_GAP,
    HIGH_STOP,
    INTEGRAL,
    INTEGRATING,
    LOAD_STIFFNESS,
    LOW_STOP,
    OFFSET,
    OUTPUT,
    POLE_PAIRS,
    POSITION_GAIN,
    PROPORTIONAL,
    SIN,
    SPEED,
    SPEED_LIMIT,
    STATIC,
    STEP_PER_INERTIA,
    TORQUE,
    TORQUE_LIMIT,
    TORQUE_SHARE,
    VISCOUS,
    control_and_motion,
    moving_state,
)
from emaphm.simulation.laws.angles import phase_angles, turn, wrap_once
from emaphm.simulation.laws.commutation import demand_sign, trapezoid
from emaphm.simulation.laws.eccentricity import gap_factors
from emaphm.simulation.laws.inline import clip
from emaphm.simulation.laws.inverter import switch
from emaphm.simulation.laws.lag import approach
from emaphm.simulation.laws.motion import move
from emaphm.simulation.laws.position_loop import speed_error
from emaphm.simulation.laws.speed_loop import current_demand
from emaphm.simulation.laws.star_windings import star_slopes

CHANNELS = (
    "current_A",
    "voltage_V",
    "position_rad",
    "speed_rad_s",
    "angle_rad",
    "torque_Nm",
    "reference_current_A",
    "current_a_A",
    "current_b_A",
    "current_c_A",
    "current_active_A",
    "current_magnitude_A",
    "voltage_a_V",
    "voltage_b_V",
    "voltage_c_V",
)

CURRENT_A, CURRENT_B, CURRENT_C, LEG_A, LEG_B, LEG_C = range(CURRENT, CURRENT + 6)
SUMS = CURRENT + 6
(
    HYSTERESIS,
    HALF_SUPPLY,
    RESISTANCE_A,
    RESISTANCE_B,
    RESISTANCE_C,
    STEP_PER_HENRY_A,
    STEP_PER_HENRY_B,
    STEP_PER_HENRY_C,
    HENRIES_PER_STEP,
    FLUX_A,
    FLUX_B,
    FLUX_C,
    Z_COS,
    Z_SIN,
) = range(len(CONTROL_AND_MOTION), len(CONTROL_AND_MOTION) + 14)


def parameters(plant: Plant, step: float) -> NDArray[np.float64]:
    """Return the kernel's parameters, shape (rows, n), for `plant` at `step` [s]."""
    per_henry = step / (plant.inductance / 2 * plant.turns**2)
    return np.concatenate(
        [
            control_and_motion(plant, step),
            [plant.hysteresis, plant.supply / 2],
            plant.resistance / 2 * plant.turns,
            per_henry,
            [1 / per_henry.sum(axis=0)],
            plant.torque_constant / 2 * plant.turns,
            plant.z,
        ]
    )


def initial_state(plant: Plant, inputs: Inputs, start: Initial) -> NDArray[np.float64]:
    """Return the kernel's state at `start`, shape (rows, n): no current, all legs low."""
    x = moving_state(plant, inputs, start, currents=6)
    x[LEG_A : LEG_C + 1] = -1.0
    return x


def build(layout: Layout) -> Any:
    """Return the kernel's Python function; `compilation` has its arguments.

    The order within a step is that of docs/physics.md, section 3: commutation, switching and back-EMF from
    the state at the step's start, currents by explicit Euler, torque from the new currents, then the motion.
    """

    def kernel(
        x: Any,
        p: Any,
        command: Any,
        load: Any,
        load_stride: Any,
        noise: Any,
        noise_stride: Any,
        step: Any,
        samples: Any,
        substeps: Any,
        window: Any,
        carried: Any,
        out: Any,
    ) -> None:
        lanes, channels = layout[0], layout[1]
        observed, traced = channels > 1, channels > len(OBSERVABLE)
        first, last = SUMS * lanes, (SUMS + channels) * lanes
        for sample in range(samples):
            for i in range(first, last):
                x[i] = 0.0
            for substep in range(substeps):
                now = sample * substeps + substep
                commanded, loaded, disturbed = (
                    command[now],
                    load[now * load_stride],
                    noise[now * noise_stride],
                )
                weight = 1.0 if substep < window else 0.0
                for lane in range(lanes):
                    speed = x[SPEED * lanes + lane]
                    angle = x[ANGLE * lanes + lane]
                    electrical = x[ELECTRICAL * lanes + lane]
                    cos, sin = x[COS * lanes + lane], x[SIN * lanes + lane]
                    integral = x[INTEGRAL * lanes + lane]
                    tau = p[GEAR_RATIO * lanes + lane]

                    measured = approach(x[FEEDBACK * lanes + lane], speed, p[FEEDBACK_SHARE * lanes + lane])
                    output = x[OUTPUT * lanes + lane]
                    error = speed_error(
                        commanded,
                        tau * output,
                        measured,
                        p[POSITION_GAIN * lanes + lane],
                        p[SPEED_LIMIT * lanes + lane],
                    )
                    reference = disturbed + current_demand(
                        error,
                        integral,
                        error - x[ERROR * lanes + lane],
                        p[PROPORTIONAL * lanes + lane],
                        p[INTEGRATING * lanes + lane],
                        p[DERIVATIVE * lanes + lane],
                        p[CURRENT_LIMIT * lanes + lane],
                    )

                    angle_a, angle_b, angle_c = phase_angles(electrical)
                    active_a, active_b, active_c = (
                        demand_sign(angle_a),
                        demand_sign(angle_b),
                        demand_sign(angle_c),
                    )
                    shape_a, shape_b, shape_c = trapezoid(angle_a), trapezoid(angle_b), trapezoid(angle_c)
                    current_a = x[CURRENT_A * lanes + lane]
                    current_b = x[CURRENT_B * lanes + lane]
                    current_c = x[CURRENT_C * lanes + lane]
                    band = p[HYSTERESIS * lanes + lane]
                    leg_a = switch(x[LEG_A * lanes + lane], reference * active_a - current_a, band)
                    leg_b = switch(x[LEG_B * lanes + lane], reference * active_b - current_b, band)
                    leg_c = switch(x[LEG_C * lanes + lane], reference * active_c - current_c, band)

                    gap_a, gap_b, gap_c = gap_factors(
                        cos, sin, p[Z_COS * lanes + lane], p[Z_SIN * lanes + lane]
                    )
                    flux_a = p[FLUX_A * lanes + lane] * gap_a * shape_a
                    flux_b = p[FLUX_B * lanes + lane] * gap_b * shape_b
                    flux_c = p[FLUX_C * lanes + lane] * gap_c * shape_c
                    half_supply = p[HALF_SUPPLY * lanes + lane]
                    rise_a, rise_b, rise_c = star_slopes(
                        leg_a * half_supply - p[RESISTANCE_A * lanes + lane] * current_a - flux_a * speed,
                        leg_b * half_supply - p[RESISTANCE_B * lanes + lane] * current_b - flux_b * speed,
                        leg_c * half_supply - p[RESISTANCE_C * lanes + lane] * current_c - flux_c * speed,
                        p[STEP_PER_HENRY_A * lanes + lane],
                        p[STEP_PER_HENRY_B * lanes + lane],
                        p[STEP_PER_HENRY_C * lanes + lane],
                        p[HENRIES_PER_STEP * lanes + lane],
                    )
                    current_a += rise_a
                    current_b += rise_b
                    current_c += rise_c
                    limit = p[TORQUE_LIMIT * lanes + lane]
                    produced = clip(
                        flux_a * current_a + flux_b * current_b + flux_c * current_c, -limit, limit
                    )
                    torque = approach(x[TORQUE * lanes + lane], produced, p[TORQUE_SHARE * lanes + lane])

                    moved, reached, followed = move(
                        speed,
                        angle,
                        output,
                        torque
                        - loaded
                        - p[OFFSET * lanes + lane]
                        - p[LOAD_STIFFNESS * lanes + lane] * output,
                        p[VISCOUS * lanes + lane],
                        p[STATIC * lanes + lane],
                        p[COULOMB * lanes + lane],
                        p[HALF_GAP * lanes + lane],
                        p[LOW_STOP * lanes + lane],
                        p[HIGH_STOP * lanes + lane],
                        step,
                        p[STEP_PER_INERTIA * lanes + lane],
                    )
                    turned = reached - angle
                    x[CURRENT_A * lanes + lane] = current_a
                    x[CURRENT_B * lanes + lane] = current_b
                    x[CURRENT_C * lanes + lane] = current_c
                    x[LEG_A * lanes + lane] = leg_a
                    x[LEG_B * lanes + lane] = leg_b
                    x[LEG_C * lanes + lane] = leg_c
                    x[SPEED * lanes + lane] = moved
                    x[FEEDBACK * lanes + lane] = measured
                    x[TORQUE * lanes + lane] = torque
                    x[ANGLE * lanes + lane] = reached
                    x[OUTPUT * lanes + lane] = followed
                    x[ELECTRICAL * lanes + lane] = wrap_once(
                        electrical + p[POLE_PAIRS * lanes + lane] * turned
                    )
                    x[COS * lanes + lane], x[SIN * lanes + lane] = turn(cos, sin, turned)
                    x[INTEGRAL * lanes + lane] = integral + error * step
                    x[ERROR * lanes + lane] = error

                    x[first + lane] += (
                        weight * 0.5 * (shape_a * current_a + shape_b * current_b + shape_c * current_c)
                    )
                    if observed:
                        across = active_a * leg_a + active_b * leg_b + active_c * leg_c
                        x[first + lanes + lane] += weight * across * half_supply
                        x[first + 2 * lanes + lane] += weight * tau * (output + carried * (followed - output))
                        x[first + 3 * lanes + lane] += weight * (speed + carried * (moved - speed))
                    if traced:
                        along = active_a * current_a + active_b * current_b + active_c * current_c
                        size = np.abs(current_a) + np.abs(current_b) + np.abs(current_c)
                        x[first + 4 * lanes + lane] += weight * (angle + carried * turned)
                        x[first + 5 * lanes + lane] += weight * torque
                        x[first + 6 * lanes + lane] += weight * reference
                        x[first + 7 * lanes + lane] += weight * current_a
                        x[first + 8 * lanes + lane] += weight * current_b
                        x[first + 9 * lanes + lane] += weight * current_c
                        x[first + 10 * lanes + lane] += weight * 0.5 * along
                        x[first + 11 * lanes + lane] += weight * 0.5 * np.copysign(size, torque)
                        x[first + 12 * lanes + lane] += weight * leg_a * half_supply
                        x[first + 13 * lanes + lane] += weight * leg_b * half_supply
                        x[first + 14 * lanes + lane] += weight * leg_c * half_supply
            for i in range(channels):
                for lane in range(lanes):
                    out[lane, i, sample] = x[first + i * lanes + lane] / window

    return kernel


REFERENCE = Model("reference", 1e-6, CHANNELS, True, parameters, initial_state, build)
"""The reference model at its step of 1 µs."""
