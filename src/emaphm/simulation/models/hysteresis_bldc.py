"""BLDC motor with three switched phases: hysteresis control of each current (thesis 3.1, chapter 4)."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from emaphm.arrays import Array
from emaphm.simulation.engine.inputs import Inputs
from emaphm.simulation.engine.model import OBSERVABLE, Form, Initial
from emaphm.simulation.engine.plant import Plant
from emaphm.simulation.engine.structure import Structure
from emaphm.simulation.laws.angles import phase_angles
from emaphm.simulation.laws.commutation import trapezoid
from emaphm.simulation.laws.eccentricity import gap_factors
from emaphm.simulation.laws.inverter import switch
from emaphm.simulation.laws.phases import Phases, phase_names
from emaphm.simulation.models import control, motion, three_phases

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

OWN_PARAMETERS = ("hysteresis",)
LEGS = phase_names("leg")


def parameters(plant: Plant, step: float) -> dict[str, Array]:
    """Return the kernel's parameters for `plant` at `step` [s], (n,) each."""
    windings = three_phases.parameters(plant, step, 0.5)
    own = {"hysteresis": plant.hysteresis}
    return control.parameters(plant, step) | motion.parameters(plant, step) | windings | own


def initial_state(plant: Plant, inputs: Inputs, start: Initial) -> dict[str, Array]:
    """Return the kernel's state at `start`, (n,) each: currents of 0, all legs low."""
    mechanical = control.initial_state(plant, inputs, start) | motion.initial_state(plant, start)
    windings = three_phases.initial_state(plant)
    signals = three_phases.initial_signals(plant, mechanical["electrical"])
    return mechanical | windings | signals | dict.fromkeys(LEGS, np.full(plant.count, -1.0))


def outputs_of(
    active: Phases, shape: Phases, sensed: Phases, voltage: Phases, recorded: Any, torque: Any, reference: Any
) -> tuple[Any, ...]:
    """Return the `CHANNELS` of a motor with trapezoidal back-EMF.

    `active` is the reference current of each phase relative to the drive's, `shape` the unit trapezoid,
    `sensed` the output of the current sensors and `recorded` the motion, from `motion.recorded_motion`.
    """
    return (
        0.5 * (shape * sensed).sum(),
        (active * voltage).sum(),
        *recorded,
        torque,
        reference,
        *sensed,
        0.5 * (active * sensed).sum(),
        0.5 * np.copysign(np.abs(sensed).sum(), torque),
        *voltage,
    )


def advance(structure: Structure) -> Callable[..., Any]:
    """Return the step of one actuator, a function of (state, parameters, inputs).

    The order within a step is that of docs/physics.md, section 3: commutation, switching and back-EMF from
    the state at the start of the step, currents by explicit Euler, torque from the new currents, then motion.
    """
    demand_of, driven = control.control(structure), motion.driven_motion(structure)
    laws = three_phases.laws(structure)

    def advance_one(s: Any, p: Any, u: Any) -> Any:
        demand, controlled = demand_of(s, p, u)
        reference = u.noise + demand
        angle = phase_angles(s.electrical)
        (active, signals), shape = laws.commutation(s, p, angle), trapezoid(angle)
        leg = switch(Phases.of(s, "leg"), reference * active - laws.sensed_before(s), p.hysteresis)

        current = Phases.of(s, "current")
        gap, emf = gap_factors(s.cos, s.sin, p.z_cos, p.z_sin), laws.emf_shape(p, angle, shape)
        flux = laws.flux(current, p, gap, emf)
        voltage = leg * laws.half_supply(s, p)
        back_emf = laws.against(current, p, flux * s.speed)
        current = u.enabled * three_phases.currents_after(current, p, voltage, back_emf)
        torque, following = driven(s, p, u, (flux * current).sum())
        sensed = laws.sensed_after(s, p, current)
        recorded = motion.recorded_motion(s, p, u, following)
        outputs = outputs_of(active, shape, sensed, u.enabled * voltage, recorded, torque, reference)
        drawn = laws.bus_after((leg * current).sum())
        own = (torque, *current, *leg, *drawn, *laws.sensor_state(sensed), *signals)
        return controlled + following + own, outputs

    return advance_one


HYSTERESIS_BLDC = Form(
    channels=CHANNELS,
    observable=OBSERVABLE,
    parameters=parameters,
    initial_state=initial_state,
    state_names=partial(three_phases.state_names, own=LEGS),
    parameter_names=partial(three_phases.parameter_names, own=OWN_PARAMETERS),
    advance=advance,
    neutral=control.NEUTRAL | motion.NEUTRAL,
)
"""BLDC motor and drive of the thesis."""
