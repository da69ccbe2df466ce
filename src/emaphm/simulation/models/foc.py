"""Reference model of a PMSM under field-oriented control with pulse-width modulation.

PI controllers control the currents in d (to 0) and q (to the demand of the speed loop). They sample at the
start of a PWM period; the resulting voltage is applied during the next period, rotated ahead by the angle
that the rotor covers until the middle of that period. Voltages and currents in d and q are line values
(`laws/sine_motor.py`).
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
from emaphm.simulation.laws.angles import turn
from emaphm.simulation.laws.current_control import limited_pi_pair
from emaphm.simulation.laws.eccentricity import gap_factors
from emaphm.simulation.laws.phases import Phases, by_phase, phase_names
from emaphm.simulation.laws.pulse_width import CONTROL_DELAY, carrier_after, centred, leg_mean, triangle
from emaphm.simulation.laws.select import select
from emaphm.simulation.laws.sine_motor import (
    INVERSE_SQRT3,
    line_currents,
    line_voltages,
    phase_sines,
    phase_voltages,
)
from emaphm.simulation.models import control, motion, three_phases

FOC_OBSERVABLE = (*OBSERVABLE, "current_d_A", "current_q_A", "voltage_d_V", "voltage_q_V")

FOC_CHANNELS = (
    *FOC_OBSERVABLE,
    "angle_rad",
    "torque_Nm",
    "reference_current_A",
    "current_a_A",
    "current_b_A",
    "current_c_A",
    "voltage_a_V",
    "voltage_b_V",
    "voltage_c_V",
)

OWN_PARAMETERS = ("current_gain", "current_integral_gain", "period", "step_per_period", "angle_ahead")

OWN_STATE = (
    "electrical_cos",
    "electrical_sin",
    "integral_d",
    "integral_q",
    "carrier",
    *phase_names("duty"),
    *phase_names("next"),
)


def parameters(plant: Plant, step: float) -> dict[str, Array]:
    """Return the kernel's parameters for `plant` at `step` [s], (n,) each."""
    own = three_phases.current_loop_parameters(plant, step)
    own["angle_ahead"] = CONTROL_DELAY * own["period"] * plant.pole_pairs
    windings = three_phases.parameters(plant, step, INVERSE_SQRT3)
    return control.parameters(plant, step) | motion.parameters(plant, step) | windings | own


def initial_state(
    plant: Plant, inputs: Inputs, start: Initial, own: tuple[str, ...] = OWN_STATE
) -> dict[str, Array]:
    """Return the kernel's state at `start`, (n,) each.

    At rest there is no current, and no voltage for two periods. In motion the current controllers are in
    steady state: i_d = 0, i_q is the demand of the speed loop, and the integrals are the voltages that
    maintain these currents, which are applied. `own` are the names of the state of controller and modulation.
    """
    mechanical = control.initial_state(plant, inputs, start) | motion.initial_state(plant, start)
    angle = plant.pole_pairs * motion.rotor_angle(plant, start)
    cos, sin = np.cos(angle), np.sin(angle)
    state = mechanical | three_phases.initial_state(plant) | dict.fromkeys(own, np.zeros(plant.count))
    return state | {"electrical_cos": cos, "electrical_sin": sin} | _settled(plant, inputs, start, cos, sin)


def _settled(plant: Plant, inputs: Inputs, start: Initial, cos: Array, sin: Array) -> dict[str, Array]:
    """Return the steady state of the currents and their controller at `start`; zeros at rest."""
    current = control.steady_current(plant, inputs, start)
    inductance = plant.inductance * (plant.turns**2).mean(axis=0)
    voltage_d = -plant.pole_pairs * start.speed * inductance * current
    voltage_q = control.steady_voltage(plant, current, start.speed)
    duty = centred(phase_voltages(voltage_d, voltage_q, cos, sin) / (plant.supply / 2))
    # The amplitude of a phase's current is 2/√3 of the line value, that of its voltage 1/√3.
    phases = phase_voltages(0.0, 2.0 * current, cos, sin)
    return {
        "integral_d": voltage_d,
        "integral_q": voltage_q,
        "voltage_d": voltage_d,
        "voltage_q": voltage_q,
        **by_phase("duty", duty),
        **by_phase("next", duty),
        **by_phase("current", phases),
        **by_phase("sensed", phases),
    }


def turn_unit(cos: Any, sin: Any, angle: Any) -> Any:
    """Return the electrical direction rotated by a small angle, with its length kept at 1.

    With P pole pairs the electrical angle of a step is P times the mechanical angle, and the error of the
    length by a rotation is P⁶ times as large.
    """
    cos, sin = turn(cos, sin, angle)
    length = 1.5 - 0.5 * (cos * cos + sin * sin)
    return length * cos, length * sin


def advance(structure: Structure) -> Callable[..., Any]:
    """Return the step of one actuator, a function of (state, parameters, inputs).

    The order within a step is that of the thesis's drive: control, switching and back-EMF from the state at
    the start of the step, currents by explicit Euler, torque from the new currents, then the motion.
    """
    demand_of, driven = control.control(structure), motion.driven_motion(structure)
    laws = three_phases.laws(structure)

    def advance_one(s: Any, p: Any, u: Any) -> Any:
        demand, controlled = demand_of(s, p, u)
        reference = u.noise + demand
        half_supply, speed = laws.half_supply(s, p), s.speed
        cos, sin = s.electrical_cos, s.electrical_sin

        in_d, in_q = line_currents(laws.sensed_before(s), cos, sin)
        demanded_d, demanded_q, integral_d, integral_q = limited_pi_pair(
            -in_d,
            reference - in_q,
            s.integral_d,
            s.integral_q,
            p.current_gain,
            p.current_integral_gain,
            2.0 * half_supply,
            p.period,
        )
        ahead_cos, ahead_sin = turn(cos, sin, p.angle_ahead * speed)
        demanded_duty = centred(phase_voltages(demanded_d, demanded_q, ahead_cos, ahead_sin) / half_supply)
        begins = s.carrier < 0.5 * p.step_per_period
        duty = select(begins, Phases.of(s, "next"), Phases.of(s, "duty"))
        leg = leg_mean(duty, triangle(s.carrier, p.step_per_period), p.step_per_period)

        current = Phases.of(s, "current")
        gap = gap_factors(s.cos, s.sin, p.z_cos, p.z_sin)
        flux = laws.flux(current, p, gap, phase_sines(cos, sin))
        voltage = leg * half_supply
        back_emf = laws.against(current, p, flux * speed)
        current = u.enabled * three_phases.currents_after(current, p, voltage, back_emf)
        torque, following = driven(s, p, u, (flux * current).sum())

        sensed = laws.sensed_after(s, p, current)
        sensed_d, sensed_q = line_currents(sensed, cos, sin)
        voltage_d, voltage_q = line_voltages(voltage, cos, sin)
        position, speed_after, angle = motion.recorded_motion(s, p, u, following)
        outputs = (
            sensed_q,
            u.enabled * voltage_q,
            position,
            speed_after,
            sensed_d,
            sensed_q,
            u.enabled * voltage_d,
            u.enabled * voltage_q,
            angle,
            torque,
            reference,
            *sensed,
            *(u.enabled * voltage),
        )
        direction = turn_unit(cos, sin, p.pole_pairs * (following[1] - s.angle))
        drive = (
            u.enabled * select(begins, integral_d, s.integral_d),
            u.enabled * select(begins, integral_q, s.integral_q),
            carrier_after(s.carrier, p.step_per_period),
            *duty,
            *(u.enabled * select(begins, demanded_duty, Phases.of(s, "next"))),
        )
        drawn = laws.bus_after((leg * current).sum())
        own = (torque, *current, *direction, *drive, *drawn, *laws.sensor_state(sensed))
        return controlled + following + own, outputs

    return advance_one


FOC = Form(
    channels=FOC_CHANNELS,
    observable=FOC_OBSERVABLE,
    parameters=parameters,
    initial_state=initial_state,
    state_names=partial(three_phases.state_names, own=OWN_STATE),
    parameter_names=partial(three_phases.parameter_names, own=OWN_PARAMETERS),
    advance=advance,
    neutral=control.NEUTRAL | motion.NEUTRAL,
)
"""PMSM with field-oriented control and PWM."""
