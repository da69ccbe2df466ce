"""Averaged model of a PMSM under field-oriented control: without ripple, so that a step may be a PWM period.

The mean voltages of the legs act on the three windings, whose currents over a step are exact for constant
voltages (`star_currents_after`). Shorts and eccentricity act on each phase. Angles are taken in the middle of
the step. If the step is a PWM period, the controller is that of the reference model; otherwise its mean delay
is the same (`delay_shares`).
"""

from collections.abc import Callable
from functools import partial
from typing import Any

from emaphm.arrays import Array
from emaphm.simulation.engine.model import Form
from emaphm.simulation.engine.plant import Plant
from emaphm.simulation.engine.structure import Structure
from emaphm.simulation.laws.angles import turn
from emaphm.simulation.laws.current_control import limited_pi_pair
from emaphm.simulation.laws.eccentricity import gap_factors
from emaphm.simulation.laws.phases import Phases
from emaphm.simulation.laws.pulse_width import delay_shares, delayed
from emaphm.simulation.laws.sine_motor import INVERSE_SQRT3, line_currents, phase_sines, phase_voltages
from emaphm.simulation.laws.star_windings import star_currents_after, star_response
from emaphm.simulation.models import control, foc, motion, three_phases

CHANNELS = (
    *foc.FOC_OBSERVABLE,
    "angle_rad",
    "torque_Nm",
    "reference_current_A",
    "current_a_A",
    "current_b_A",
    "current_c_A",
)

OWN_PARAMETERS = (
    "current_gain",
    "current_integral_gain",
    "voltage_share",
    "voltage_at_once",
    "remaining_aa",
    "remaining_ab",
    "remaining_ba",
    "remaining_bb",
    "conductance_aa",
    "conductance_ab",
    "conductance_bb",
)

OWN_STATE = ("electrical_cos", "electrical_sin", "integral_d", "integral_q", "voltage_d", "voltage_q")


def parameters(plant: Plant, step: float) -> dict[str, Array]:
    """Return the kernel's parameters for `plant` at `step` [s], (n,) each."""
    share, at_once = delay_shares(plant.pwm_frequency, step)
    own = {
        "current_gain": plant.current_gain,
        "current_integral_gain": plant.current_integral_gain,
        "voltage_share": share,
        "voltage_at_once": at_once,
    }
    response = star_response(plant.resistance / 2 * plant.turns, plant.inductance / 2 * plant.turns**2, step)
    windings = three_phases.parameters(plant, step, INVERSE_SQRT3)
    return control.parameters(plant, step) | motion.parameters(plant, step) | windings | response | own


def advance(structure: Structure) -> Callable[..., Any]:
    """Return the step of one actuator, a function of (state, parameters, inputs)."""
    demand_of, driven = control.control(structure), motion.driven_motion(structure)
    laws = three_phases.laws(structure)

    def advance_one(s: Any, p: Any, u: Any) -> Any:
        reference, controlled = demand_of(s, p, u)
        supply, speed = 2.0 * laws.half_supply(s, p), s.speed

        sensed_before = laws.sensed_before(s)
        in_d, in_q = line_currents(sensed_before, s.electrical_cos, s.electrical_sin)
        demanded_d, demanded_q, integral_d, integral_q = limited_pi_pair(
            -in_d,
            reference - in_q,
            s.integral_d,
            s.integral_q,
            p.current_gain,
            p.current_integral_gain,
            supply,
            u.step,
        )
        voltage_d, lagging_d = delayed(s.voltage_d, demanded_d, p.voltage_share, p.voltage_at_once)
        voltage_q, lagging_q = delayed(s.voltage_q, demanded_q, p.voltage_share, p.voltage_at_once)

        half = 0.5 * u.step * speed
        rotor_cos, rotor_sin = turn(s.cos, s.sin, half)
        cos, sin = turn(s.electrical_cos, s.electrical_sin, p.pole_pairs * half)
        gap = gap_factors(rotor_cos, rotor_sin, p.z_cos, p.z_sin)
        before = Phases.of(s, "current")
        flux = laws.flux(before, p, gap, phase_sines(cos, sin))
        voltage = phase_voltages(voltage_d, voltage_q, cos, sin)
        current = u.enabled * star_currents_after(
            before,
            voltage - laws.against(before, p, flux * speed),
            p.remaining_aa,
            p.remaining_ab,
            p.remaining_ba,
            p.remaining_bb,
            p.conductance_aa,
            p.conductance_ab,
            p.conductance_bb,
        )
        mean = 0.5 * (before + current)
        torque, following = driven(s, p, u, u.enabled * (flux * mean).sum())

        sensed = laws.sensed_after(s, p, current)
        shown = 0.5 * (sensed_before + sensed)
        shown_d, shown_q = line_currents(shown, cos, sin)
        voltage_d, voltage_q = u.enabled * voltage_d, u.enabled * voltage_q
        position, speed_after, angle = motion.recorded_motion(s, p, u, following)
        outputs = (
            shown_q,
            voltage_q,
            position,
            speed_after,
            shown_d,
            shown_q,
            voltage_d,
            voltage_q,
            angle,
            torque,
            reference,
            *shown,
        )
        direction = foc.turn_unit(s.electrical_cos, s.electrical_sin, p.pole_pairs * (following[1] - s.angle))
        lagging = (integral_d, integral_q, lagging_d, lagging_q)
        # The voltages divided by half the supply voltage are the leg states, less their common part.
        drawn = laws.bus_after(2.0 * (voltage * mean).sum() / supply)
        controller = (u.enabled * value for value in lagging)
        own = (torque, *current, *direction, *controller, *drawn, *laws.sensor_state(sensed))
        return controlled + following + own, outputs

    return advance_one


FOC_AVERAGED = Form(
    channels=CHANNELS,
    observable=foc.FOC_OBSERVABLE,
    parameters=parameters,
    initial_state=partial(foc.initial_state, own=OWN_STATE),
    state_names=partial(three_phases.state_names, own=OWN_STATE),
    parameter_names=partial(three_phases.parameter_names, own=OWN_PARAMETERS),
    advance=advance,
    neutral=control.NEUTRAL | motion.NEUTRAL,
)
"""PMSM with field-oriented control and averaged PWM."""
