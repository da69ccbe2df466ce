"""Reference model of a BLDC motor under six-step control with pulse-width modulation.

A PI controller controls the equivalent current, which does not jump at commutation. It samples at the start
of a PWM period; the resulting voltage is applied during the next period. The two conducting legs switch
together to opposite rails. The switches of the third leg are off, so that its current decays through a diode
and remains 0 (`laws/idle_leg.py`).
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
from emaphm.simulation.laws.phases import Phases, by_phase
from emaphm.simulation.laws.pulse_width import carrier_after, leg_mean, triangle
from emaphm.simulation.laws.select import select
from emaphm.simulation.models import control, motion, three_phases
from emaphm.simulation.models.hysteresis_bldc import CHANNELS, outputs_of

OWN_PARAMETERS = ("current_gain", "current_integral_gain", "period", "step_per_period")
OWN_STATE = ("current_integral", "carrier", "duty", "next_duty")


def parameters(plant: Plant, step: float) -> dict[str, Array]:
    """Return the kernel's parameters for `plant` at `step` [s], (n,) each."""
    own = three_phases.current_loop_parameters(plant, step)
    windings = three_phases.parameters(plant, step, 0.5)
    return control.parameters(plant, step) | motion.parameters(plant, step) | windings | own


def initial_state(plant: Plant, inputs: Inputs, start: Initial) -> dict[str, Array]:
    """Return the kernel's state at `start`, (n,) each.

    At rest there is no current, and no voltage for two periods. In motion the current controller is in steady
    state: the conducting phases carry the current that the speed loop demands, and the integral is the
    voltage that maintains this current, which is applied.
    """
    mechanical = control.initial_state(plant, inputs, start) | motion.initial_state(plant, start)
    current = control.steady_current(plant, inputs, start)
    voltage = control.steady_voltage(plant, current, start.speed)
    phases = demand_sign(phase_angles(mechanical["electrical"])) * current
    own = {
        "current_integral": voltage,
        "carrier": np.zeros(plant.count),
        **dict.fromkeys(("duty", "next_duty"), voltage / plant.supply),
        **by_phase("current", phases),
        **by_phase("sensed", phases),
    }
    signals = three_phases.initial_signals(plant, mechanical["electrical"])
    return mechanical | three_phases.initial_state(plant) | own | signals


def _centre(p: Any, active: Phases, drive: Phases) -> Any:
    """Return the voltage of the star's centre [V] if only the two conducting phases carry current."""
    inverse = np.abs(active) * Phases.of(p, "step_per_henry")
    return (inverse * drive).sum() / inverse.sum()


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
        angle = phase_angles(s.electrical)
        (active, signals), shape = laws.commutation(s, p, angle), trapezoid(angle)

        demanded_voltage, integral = limited_pi(
            reference - 0.5 * (shape * laws.sensed_before(s)).sum(),
            s.current_integral,
            p.current_gain,
            p.current_integral_gain,
            2.0 * half_supply,
            p.period,
        )
        begins = s.carrier < 0.5 * p.step_per_period
        duty = select(begins, s.next_duty, s.duty)
        rail = leg_mean(duty, triangle(s.carrier, p.step_per_period), p.step_per_period) * half_supply

        before = Phases.of(s, "current")
        gap, emf = gap_factors(s.cos, s.sin, p.z_cos, p.z_sin), laws.emf_shape(p, angle, shape)
        flux = laws.flux(before, p, gap, emf)
        back_emf = laws.against(before, p, flux * speed)
        resistive = Phases.of(p, "resistance") * before
        floating = _centre(p, active, active * rail - resistive - back_emf) + back_emf
        idle = active == 0.0
        voltage = select(idle, diode_voltage(before, floating, half_supply), active * rail)
        free = three_phases.currents_after(before, p, voltage, back_emf)
        with_diode = select(idle, diode_current(before, free, floating, half_supply), free)
        # A current that a diode has stopped is subtracted from the two conducting phases, so the sum is 0.
        current = u.enabled * (with_diode - np.abs(active) * (0.5 * with_diode.sum()))
        torque, following = driven(s, p, u, (flux * current).sum())

        sensed = laws.sensed_after(s, p, current)
        recorded = motion.recorded_motion(s, p, u, following)
        outputs = outputs_of(active, shape, sensed, u.enabled * voltage, recorded, torque, reference)
        drive = (
            u.enabled * select(begins, integral, s.current_integral),
            carrier_after(s.carrier, p.step_per_period),
            duty,
            u.enabled * select(begins, demanded_voltage / (2.0 * half_supply), s.next_duty),
        )
        drawn = laws.bus_after((voltage * current).sum() / half_supply)
        own = (torque, *current, *drive, *drawn, *laws.sensor_state(sensed), *signals)
        return controlled + following + own, outputs

    return advance_one


SIX_STEP = Form(
    channels=CHANNELS,
    observable=OBSERVABLE,
    parameters=parameters,
    initial_state=initial_state,
    state_names=partial(three_phases.state_names, own=OWN_STATE),
    parameter_names=partial(three_phases.parameter_names, own=OWN_PARAMETERS),
    advance=advance,
    neutral=control.NEUTRAL | motion.NEUTRAL,
)
"""BLDC motor with PI current control and PWM."""
