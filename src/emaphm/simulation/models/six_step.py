"""A BLDC motor under six-step control, with its pulse-width modulation: the reference model's form.

PI control of the equivalent current, which does not jump where one phase takes over from another, sampled as
a PWM period begins; the voltage that answers is applied throughout the next period. The two conducting legs
switch together, to opposite rails; the third has its switches off, so that its current decays through a diode
and stays 0 (`laws/idle_leg.py`).
"""

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
from emaphm.simulation.laws.current_control import limited_pi
from emaphm.simulation.laws.eccentricity import gap_factors
from emaphm.simulation.laws.idle_leg import diode_current, diode_voltage
from emaphm.simulation.laws.lag import approach
from emaphm.simulation.laws.pulse_width import carrier_after, leg_mean, triangle
from emaphm.simulation.laws.select import clip, select
from emaphm.simulation.models import control, motion, three_phases
from emaphm.simulation.models.hysteresis_bldc import CHANNELS

OWN_PARAMETERS = ("current_gain", "current_integral_gain", "period", "step_per_period")
OWN_STATE = ("current_integral", "carrier", "duty", "next_duty")


def parameters(plant: Plant, step: float) -> dict[str, Array]:
    """Return the kernel's parameters for `plant` at `step` [s], (n,) each."""
    period = 1 / np.maximum(plant.pwm_frequency, 1.0)
    own = {
        "current_gain": plant.current_gain,
        "current_integral_gain": plant.current_integral_gain,
        "period": period,
        "step_per_period": step / period,
    }
    windings = three_phases.parameters(plant, step, 0.5)
    return control.parameters(plant, step) | motion.parameters(plant, step) | windings | own


def initial_state(plant: Plant, inputs: Inputs, start: Initial) -> dict[str, Array]:
    """Return the kernel's state at `start`, (n,) each: no current, no voltage for two periods."""
    mechanical = control.initial_state(plant, inputs, start) | motion.initial_state(plant, start)
    own = dict.fromkeys(OWN_STATE, np.zeros(plant.count))
    return mechanical | three_phases.initial_state(plant) | own


def _centre(
    p: Any, active_a: Any, active_b: Any, active_c: Any, drive_a: Any, drive_b: Any, drive_c: Any
) -> Any:
    """Return the voltage of the star's centre while only the two conducting phases carry current."""
    inverse_a = np.abs(active_a) * p.step_per_henry_a
    inverse_b = np.abs(active_b) * p.step_per_henry_b
    inverse_c = np.abs(active_c) * p.step_per_henry_c
    share = inverse_a + inverse_b + inverse_c
    return (inverse_a * drive_a + inverse_b * drive_b + inverse_c * drive_c) / share


def _leg_voltage(active: Any, rail: Any, current: Any, open_voltage: Any, half_supply: Any) -> Any:
    """Return the voltage of a leg that conducts in the direction `active`, or idles where that is 0."""
    return select(active == 0.0, diode_voltage(current, open_voltage, half_supply), active * rail)


def _leg_current(active: Any, before: Any, after: Any, open_voltage: Any, half_supply: Any) -> Any:
    return select(active == 0.0, diode_current(before, after, open_voltage, half_supply), after)


def advance(structure: Structure) -> Callable[..., Any]:
    """Return the step of one actuator.

    The order within a step is the thesis drive's: control, switching and back-EMF from the state at the
    step's start, currents by explicit Euler, torque from the new currents, then the motion.
    """
    demand_of, moved = control.control(structure), motion.motion(structure)
    flux_of, against = three_phases.flux(structure), three_phases.counter_voltage(structure)
    half_supply_of, bus_after = three_phases.supply(structure)
    sensed_before, sensed_after, sensor_state = three_phases.sensors(structure)

    def advance_one(s: Any, p: Any, u: Any) -> Any:
        demand, controlled = demand_of(s, p, u)
        reference = u.noise + demand
        half_supply, speed = half_supply_of(s, p), s.speed
        angle_a, angle_b, angle_c = phase_angles(s.electrical)
        active_a, active_b, active_c = demand_sign(angle_a), demand_sign(angle_b), demand_sign(angle_c)
        shape_a, shape_b, shape_c = trapezoid(angle_a), trapezoid(angle_b), trapezoid(angle_c)

        seen_a, seen_b, seen_c = sensed_before(s)
        measured = 0.5 * (shape_a * seen_a + shape_b * seen_b + shape_c * seen_c)
        asked, integral = limited_pi(
            reference - measured,
            s.current_integral,
            p.current_gain,
            p.current_integral_gain,
            2.0 * half_supply,
            p.period,
        )
        begins = s.carrier < 0.5 * p.step_per_period
        duty = select(begins, s.next_duty, s.duty)
        switched = leg_mean(duty, triangle(s.carrier, p.step_per_period), p.step_per_period)

        gap_a, gap_b, gap_c = gap_factors(s.cos, s.sin, p.z_cos, p.z_sin)
        flux_a, flux_b, flux_c = flux_of(s, p, gap_a, gap_b, gap_c, shape_a, shape_b, shape_c)
        back_emf_a, back_emf_b, back_emf_c = against(s, p, flux_a * speed, flux_b * speed, flux_c * speed)
        rail = switched * half_supply
        centre = _centre(
            p,
            active_a,
            active_b,
            active_c,
            active_a * rail - p.resistance_a * s.current_a - back_emf_a,
            active_b * rail - p.resistance_b * s.current_b - back_emf_b,
            active_c * rail - p.resistance_c * s.current_c - back_emf_c,
        )
        open_a, open_b, open_c = centre + back_emf_a, centre + back_emf_b, centre + back_emf_c
        voltage_a = _leg_voltage(active_a, rail, s.current_a, open_a, half_supply)
        voltage_b = _leg_voltage(active_b, rail, s.current_b, open_b, half_supply)
        voltage_c = _leg_voltage(active_c, rail, s.current_c, open_c, half_supply)

        free_a, free_b, free_c = three_phases.currents_after(
            s, p, voltage_a, voltage_b, voltage_c, back_emf_a, back_emf_b, back_emf_c
        )
        kept_a = _leg_current(active_a, s.current_a, free_a, open_a, half_supply)
        kept_b = _leg_current(active_b, s.current_b, free_b, open_b, half_supply)
        kept_c = _leg_current(active_c, s.current_c, free_c, open_c, half_supply)
        # What a diode has ended goes on through the two conducting phases, whose sum it kept.
        ended = 0.5 * (kept_a + kept_b + kept_c)
        current_a = u.enabled * (kept_a - np.abs(active_a) * ended)
        current_b = u.enabled * (kept_b - np.abs(active_b) * ended)
        current_c = u.enabled * (kept_c - np.abs(active_c) * ended)
        produced = flux_a * current_a + flux_b * current_b + flux_c * current_c
        torque = approach(s.torque, clip(produced, -p.torque_limit, p.torque_limit), p.torque_share)
        following = moved(s, p, u, torque)

        sensed = sensed_after(s, p, current_a, current_b, current_c)
        sensed_a, sensed_b, sensed_c = sensed
        size = np.abs(sensed_a) + np.abs(sensed_b) + np.abs(sensed_c)
        position, speed_after, angle = motion.recorded_motion(s, p, u, following)
        outputs = (
            0.5 * (shape_a * sensed_a + shape_b * sensed_b + shape_c * sensed_c),
            u.enabled * (active_a * voltage_a + active_b * voltage_b + active_c * voltage_c),
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
            u.enabled * voltage_a,
            u.enabled * voltage_b,
            u.enabled * voltage_c,
        )
        windings = (torque, current_a, current_b, current_c)
        drive = (
            u.enabled * select(begins, integral, s.current_integral),
            carrier_after(s.carrier, p.step_per_period),
            duty,
            u.enabled * select(begins, asked / (2.0 * half_supply), s.next_duty),
        )
        power = voltage_a * current_a + voltage_b * current_b + voltage_c * current_c
        own = windings + drive + bus_after(power / half_supply) + sensor_state(sensed)
        return controlled + following + own, outputs

    return advance_one


SIX_STEP = Form(
    CHANNELS,
    OBSERVABLE,
    parameters,
    initial_state,
    partial(three_phases.state_names, own=OWN_STATE),
    partial(three_phases.parameter_names, own=OWN_PARAMETERS),
    advance,
    control.NEUTRAL | motion.NEUTRAL,
)
"""A BLDC motor with PI current control and PWM."""
