"""A BLDC motor with three switched phases: hysteresis control of each current (thesis 3.1, chapter 4)."""

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
from emaphm.simulation.laws.commutation import demand_sign, trapezoid
from emaphm.simulation.laws.eccentricity import gap_factors
from emaphm.simulation.laws.inverter import switch
from emaphm.simulation.laws.lag import approach
from emaphm.simulation.laws.select import clip
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
LEGS = ("leg_a", "leg_b", "leg_c")


def parameters(plant: Plant, step: float) -> dict[str, Array]:
    """Return the kernel's parameters for `plant` at `step` [s], (n,) each."""
    windings = three_phases.parameters(plant, step, 0.5)
    own = {"hysteresis": plant.hysteresis}
    return control.parameters(plant, step) | motion.parameters(plant, step) | windings | own


def initial_state(plant: Plant, inputs: Inputs, start: Initial) -> dict[str, Array]:
    """Return the kernel's state at `start`, (n,) each: no current, all legs low."""
    mechanical = control.initial_state(plant, inputs, start) | motion.initial_state(plant, start)
    return mechanical | three_phases.initial_state(plant) | dict.fromkeys(LEGS, np.full(plant.count, -1.0))


def advance(structure: Structure) -> Callable[..., Any]:
    """Return the step of one actuator.

    The order within a step is that of docs/physics.md, section 3: commutation, switching and back-EMF from
    the state at the step's start, currents by explicit Euler, torque from the new currents, then the motion.
    """
    demand_of, moved = control.control(structure), motion.motion(structure)
    flux_of, against = three_phases.flux(structure), three_phases.counter_voltage(structure)
    half_supply_of, bus_after = three_phases.supply(structure)
    sensed_before, sensed_after, sensor_state = three_phases.sensors(structure)

    def advance_one(s: Any, p: Any, u: Any) -> Any:
        demand, controlled = demand_of(s, p, u)
        reference = u.noise + demand
        angle_a, angle_b, angle_c = phase_angles(s.electrical)
        active_a, active_b, active_c = demand_sign(angle_a), demand_sign(angle_b), demand_sign(angle_c)
        shape_a, shape_b, shape_c = trapezoid(angle_a), trapezoid(angle_b), trapezoid(angle_c)
        seen_a, seen_b, seen_c = sensed_before(s)
        leg_a = switch(s.leg_a, reference * active_a - seen_a, p.hysteresis)
        leg_b = switch(s.leg_b, reference * active_b - seen_b, p.hysteresis)
        leg_c = switch(s.leg_c, reference * active_c - seen_c, p.hysteresis)

        gap_a, gap_b, gap_c = gap_factors(s.cos, s.sin, p.z_cos, p.z_sin)
        flux_a, flux_b, flux_c = flux_of(s, p, gap_a, gap_b, gap_c, shape_a, shape_b, shape_c)
        half_supply, speed = half_supply_of(s, p), s.speed
        back_emf_a, back_emf_b, back_emf_c = against(s, p, flux_a * speed, flux_b * speed, flux_c * speed)
        current_a, current_b, current_c = three_phases.currents_after(
            s,
            p,
            leg_a * half_supply,
            leg_b * half_supply,
            leg_c * half_supply,
            back_emf_a,
            back_emf_b,
            back_emf_c,
        )
        current_a, current_b, current_c = u.enabled * current_a, u.enabled * current_b, u.enabled * current_c
        produced = flux_a * current_a + flux_b * current_b + flux_c * current_c
        torque = approach(s.torque, clip(produced, -p.torque_limit, p.torque_limit), p.torque_share)
        following = moved(s, p, u, torque)
        sensed = sensed_after(s, p, current_a, current_b, current_c)
        sensed_a, sensed_b, sensed_c = sensed
        position, speed_after, angle = motion.recorded_motion(s, p, u, following)
        size = np.abs(sensed_a) + np.abs(sensed_b) + np.abs(sensed_c)
        outputs = (
            0.5 * (shape_a * sensed_a + shape_b * sensed_b + shape_c * sensed_c),
            (active_a * leg_a + active_b * leg_b + active_c * leg_c) * half_supply,
            position,
            speed_after,
            angle,
            torque,
            reference,
            sensed_a,
            sensed_b,
            sensed_c,
            0.5 * (active_a * sensed_a + active_b * sensed_b + active_c * sensed_c),
            0.5 * np.copysign(size, torque),
            leg_a * half_supply,
            leg_b * half_supply,
            leg_c * half_supply,
        )
        drive = (torque, current_a, current_b, current_c, leg_a, leg_b, leg_c)
        drawn = bus_after(leg_a * current_a + leg_b * current_b + leg_c * current_c)
        return controlled + following + drive + drawn + sensor_state(sensed), outputs

    return advance_one


HYSTERESIS_BLDC = Form(
    CHANNELS,
    OBSERVABLE,
    parameters,
    initial_state,
    partial(three_phases.state_names, own=LEGS),
    partial(three_phases.parameter_names, own=OWN_PARAMETERS),
    advance,
    control.NEUTRAL | motion.NEUTRAL,
)
"""The thesis's motor and drive."""
