"""The kernel of the models with one equivalent winding: the monitor model and the averaged model.

The two conducting phases of the rotor's sector are one winding. Its rows come from three pairs of
phases, each named by the phase that idles: pair a is b with c, and so on.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from emaphm.simulation.engine.inputs import Inputs
from emaphm.simulation.engine.model import OBSERVABLE, Initial, Layout
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
from emaphm.simulation.laws.angles import turn, wrap_once
from emaphm.simulation.laws.commutation import of_idle_phase
from emaphm.simulation.laws.eccentricity import gap_factors, printed_factor
from emaphm.simulation.laws.equivalent_winding import winding_current
from emaphm.simulation.laws.inline import clip, select
from emaphm.simulation.laws.lag import approach
from emaphm.simulation.laws.motion import move
from emaphm.simulation.laws.position_loop import speed_error
from emaphm.simulation.laws.speed_loop import current_demand

CHANNELS = (
    "current_A",
    "voltage_V",
    "position_rad",
    "speed_rad_s",
    "angle_rad",
    "torque_Nm",
    "reference_current_A",
)

SUMS = CURRENT + 1
(
    SUPPLY,
    CONDUCTANCE_A,
    CONDUCTANCE_B,
    CONDUCTANCE_C,
    DECAY_A,
    DECAY_B,
    DECAY_C,
    FLUX_A,
    FLUX_B,
    FLUX_C,
    Z_COS,
    Z_SIN,
) = range(len(CONTROL_AND_MOTION), len(CONTROL_AND_MOTION) + 12)


def parameters(
    plant: Plant,
    step: float,
    pair_turns: NDArray[np.float64],
    pair_squares: NDArray[np.float64],
    phase_turns: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the kernel's parameters, shape (rows, n), for `plant` at `step` [s].

    `pair_turns` (3, n) scales each pair's resistance, `pair_squares` (3, n) its inductance, and
    `phase_turns` (3, n) each phase's share of the torque constant, all 1 when healthy.
    """
    resistance = plant.resistance * pair_turns
    return np.concatenate(
        [
            control_and_motion(plant, step),
            [plant.supply],
            1 / resistance,
            np.exp(-step * resistance / (plant.inductance * pair_squares)),
            plant.torque_constant / 2 * phase_turns,
            plant.z,
        ]
    )


def initial_state(plant: Plant, inputs: Inputs, start: Initial) -> NDArray[np.float64]:
    """Return the kernel's state at `start`, shape (rows, n), without current."""
    return moving_state(plant, inputs, start, currents=1)


def build(layout: Layout, *, averaged: bool, printed_eccentricity: bool) -> Any:
    """Return the kernel's Python function; `compilation` has its arguments.

    `averaged`: the current follows its reference as far as the supply can force it within a step;
    otherwise the full supply is switched by the sign of the current error. `printed_eccentricity`: the
    thesis's factor for the monitor model instead of the reference model's.
    """

    def kernel(
        x: Any,
        p: Any,
        command: Any,
        load: Any,
        load_stride: Any,
        _noise: Any,
        _noise_stride: Any,
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
                commanded, loaded = command[now], load[now * load_stride]
                weight = 1.0 if substep < window else 0.0
                for lane in range(lanes):
                    speed = x[SPEED * lanes + lane]
                    angle = x[ANGLE * lanes + lane]
                    electrical = x[ELECTRICAL * lanes + lane]
                    cos, sin = x[COS * lanes + lane], x[SIN * lanes + lane]
                    integral = x[INTEGRAL * lanes + lane]
                    tau = p[GEAR_RATIO * lanes + lane]
                    pole_pairs = p[POLE_PAIRS * lanes + lane]

                    measured = approach(x[FEEDBACK * lanes + lane], speed, p[FEEDBACK_SHARE * lanes + lane])
                    output = x[OUTPUT * lanes + lane]
                    error = speed_error(
                        commanded,
                        tau * output,
                        measured,
                        p[POSITION_GAIN * lanes + lane],
                        p[SPEED_LIMIT * lanes + lane],
                    )
                    reference = current_demand(
                        error,
                        integral,
                        error - x[ERROR * lanes + lane],
                        p[PROPORTIONAL * lanes + lane],
                        p[INTEGRATING * lanes + lane],
                        p[DERIVATIVE * lanes + lane],
                        p[CURRENT_LIMIT * lanes + lane],
                    )

                    z_cos, z_sin = p[Z_COS * lanes + lane], p[Z_SIN * lanes + lane]
                    if printed_eccentricity:
                        gap_a = printed_factor(np.cos(electrical), np.sin(electrical), z_cos, z_sin)
                        gap_b, gap_c = gap_a, gap_a
                    else:
                        gap_a, gap_b, gap_c = gap_factors(cos, sin, z_cos, z_sin)
                    flux_a = gap_a * p[FLUX_A * lanes + lane]
                    flux_b = gap_b * p[FLUX_B * lanes + lane]
                    flux_c = gap_c * p[FLUX_C * lanes + lane]
                    flux = of_idle_phase(electrical, flux_b + flux_c, flux_c + flux_a, flux_a + flux_b)
                    conductance = of_idle_phase(
                        electrical,
                        p[CONDUCTANCE_A * lanes + lane],
                        p[CONDUCTANCE_B * lanes + lane],
                        p[CONDUCTANCE_C * lanes + lane],
                    )
                    decay = of_idle_phase(
                        electrical,
                        p[DECAY_A * lanes + lane],
                        p[DECAY_B * lanes + lane],
                        p[DECAY_C * lanes + lane],
                    )

                    before = x[CURRENT * lanes + lane]
                    supply = p[SUPPLY * lanes + lane]
                    back_emf = flux * speed
                    if averaged:
                        lowest = winding_current(before, -supply - back_emf, conductance, decay)
                        highest = winding_current(before, supply - back_emf, conductance, decay)
                        current = clip(reference, lowest, highest)
                    else:
                        side = select(reference > before, 1.0, select(reference < before, -1.0, 0.0))
                        current = winding_current(before, side * supply - back_emf, conductance, decay)
                    limit = p[TORQUE_LIMIT * lanes + lane]
                    produced = clip(flux * current, -limit, limit)
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
                    x[CURRENT * lanes + lane] = current
                    x[SPEED * lanes + lane] = moved
                    x[FEEDBACK * lanes + lane] = measured
                    x[TORQUE * lanes + lane] = torque
                    x[ANGLE * lanes + lane] = reached
                    x[OUTPUT * lanes + lane] = followed
                    x[ELECTRICAL * lanes + lane] = wrap_once(electrical + pole_pairs * turned)
                    x[COS * lanes + lane], x[SIN * lanes + lane] = turn(cos, sin, turned)
                    x[INTEGRAL * lanes + lane] = integral + error * step
                    x[ERROR * lanes + lane] = error

                    x[first + lane] += weight * current
                    if observed:
                        # The constant voltage that takes the winding from `before` to `current`.
                        voltage = back_emf + (current - decay * before) / ((1.0 - decay) * conductance)
                        x[first + lanes + lane] += weight * voltage
                        x[first + 2 * lanes + lane] += weight * tau * (output + carried * (followed - output))
                        x[first + 3 * lanes + lane] += weight * (speed + carried * (moved - speed))
                    if traced:
                        x[first + 4 * lanes + lane] += weight * (angle + carried * turned)
                        x[first + 5 * lanes + lane] += weight * torque
                        x[first + 6 * lanes + lane] += weight * reference
            for i in range(channels):
                for lane in range(lanes):
                    out[lane, i, sample] = x[first + i * lanes + lane] / window

    return kernel
