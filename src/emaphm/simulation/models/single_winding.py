"""Models with one equivalent winding: the monitor model, and the averaged model of all drives except FOC.

The two conducting phases of the rotor's sector form one winding. Its parameters are given for three pairs of
phases, each named by its idle phase: pair a is b with c, and so on. A DC motor has one winding.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from emaphm.actuator.unit.baseline import COMMUTATION, HALL_SENSORS
from emaphm.arrays import Array
from emaphm.simulation.engine.inputs import Inputs
from emaphm.simulation.engine.model import OBSERVABLE, Form, Initial
from emaphm.simulation.engine.plant import Plant
from emaphm.simulation.engine.structure import Structure
from emaphm.simulation.laws.angles import phase_angles
from emaphm.simulation.laws.eccentricity import gap_factors, printed_factor
from emaphm.simulation.laws.emf_shape import emf_shape
from emaphm.simulation.laws.equivalent_winding import winding_current
from emaphm.simulation.laws.lag import share_of_step
from emaphm.simulation.laws.phases import Phases, by_phase, phase_names
from emaphm.simulation.laws.pulse_width import delay_shares, half_ripple
from emaphm.simulation.laws.saturation import flux_left
from emaphm.simulation.laws.sensed_commutation import of_sensed_idle_phase
from emaphm.simulation.laws.supply_source import sagging_supply, supply_under_duty
from emaphm.simulation.laws.voltage_drop import knees_per_ampere, voltage_drop
from emaphm.simulation.models import control, motion
from emaphm.simulation.models.conducting_pair import NUMBERS, ConductingPair, conducting_pair
from emaphm.simulation.models.current_loop import current_loop

CHANNELS = (*OBSERVABLE, "angle_rad", "torque_Nm", "reference_current_A")
BY_VOLTAGE = (*OBSERVABLE, "duty", "angle_rad", "torque_Nm")

PARAMETERS = (
    "supply",
    *phase_names("conductance"),
    *phase_names("decay"),
    *phase_names("flux"),
    "z_cos",
    "z_sin",
    "source_resistance",
    "sensed_share",
    "sensed_lead",
    "saturation",
    "flat_loss",
    "sine_share",
    *HALL_SENSORS,
    *COMMUTATION,
    "drop",
    "per_knee",
    "current_gain",
    "current_integral_gain",
    "voltage_share",
    "voltage_at_once",
    *phase_names("winding"),
    *phase_names("fall"),
    *phase_names("half_ripple"),
)


def of_pairs(turns: Array) -> Array:
    """Return for each phase, (3, n), the sum of the two other phases, which conduct while it idles."""
    return turns[[1, 2, 0]] + turns[[2, 0, 1]]


def parameters(
    plant: Plant, step: float, pair_turns: Array, pair_squares: Array, phase_turns: Array
) -> dict[str, Array]:
    """Return the kernel's parameters for `plant` at `step` [s], (n,) each.

    `pair_turns` (3, n) are the factors of each pair's resistance, `pair_squares` (3, n) of its inductance,
    and `phase_turns` (3, n) of each phase's part of the torque constant; all are 1 for a healthy motor.
    """
    resistance, inductance = plant.resistance * pair_turns, plant.inductance * pair_squares
    sensed_share = share_of_step(plant.current_lag, step)
    windings = plant.inductance / 2 * plant.turns**2
    falls = step * (1 - 1 / (windings * (1 / windings).sum(axis=0))) / windings
    share, at_once = delay_shares(plant.pwm_frequency, step)
    frequency = np.maximum(plant.pwm_frequency, 1.0)
    # Gain of the lag from current to torque at the frequency of the ripple.
    torque_share = 1 / np.hypot(1.0, 2 * np.pi * frequency * plant.torque_lag)
    rows = {
        "supply": plant.supply,
        **by_phase("conductance", 1 / resistance),
        **by_phase("decay", np.exp(-step * resistance / inductance)),
        **by_phase("flux", plant.torque_constant / 2 * phase_turns),
        "z_cos": plant.z[0],
        "z_sin": plant.z[1],
        **by_phase("winding", windings),
        **by_phase("fall", falls),
        **by_phase("half_ripple", torque_share / (4 * frequency * inductance)),
        "voltage_share": share,
        "voltage_at_once": at_once,
        "source_resistance": plant.source_resistance,
        "sensed_share": sensed_share,
        "saturation": plant.saturation,
        "flat_loss": plant.flat_loss,
        "sine_share": plant.sine_share,
        **{name: getattr(plant, name) for name in (*HALL_SENSORS, *COMMUTATION)},
        "drop": plant.voltage_drop,
        "per_knee": knees_per_ampere(plant.current_limit),
        "sensed_lead": 1 / sensed_share - 1,
        "current_gain": plant.current_gain,
        "current_integral_gain": plant.current_integral_gain,
    }
    return control.parameters(plant, step) | motion.parameters(plant, step) | rows


def initial_state(plant: Plant, inputs: Inputs, start: Initial) -> dict[str, Array]:
    """Return the kernel's state at `start`, (n,) each, with a current of 0.

    Exception: a six-step drive in motion is in steady state, as in `six_step.initial_state`.
    """
    moving = motion.initial_state(plant, start)
    own = dict.fromkeys((*OWN_STATE, *SIX_STEP_STATE), np.zeros(plant.count))
    if plant.structure.drive == "six-step":
        current = control.steady_current(plant, inputs, start)
        voltage = control.steady_voltage(plant, current, start.speed)
        own |= {"current": current, "sensed": current, "current_integral": voltage, "voltage": voltage}
        own["idle"] = of_sensed_idle_phase(moving["electrical"], NUMBERS, Phases.of(plant, "hall"))
    return control.initial_state(plant, inputs, start) | moving | own


OWN_STATE = ("torque", "current", "bus_current", "sensed")
"""Names of the state of winding, supply and sensor."""

SIX_STEP_STATE = ("current_integral", "voltage", "outgoing", "incoming_share", "idle")
"""Names of the additional state of a six-step drive: integral and lagging voltage of its controller, current
of the outgoing phase, share of the incoming phase in the pair's inductance, number of the idle phase."""


@cache
def state_names(structure: Structure) -> tuple[str, ...]:
    """Return the names of the kernel's state."""
    return (
        *control.state_names(structure),
        *motion.state_names(structure),
        "torque",
        "current",
        *(("bus_current",) if structure.source and structure.drive != "voltage" else ()),
        *(("sensed",) if structure.current_lag else ()),
        *(SIX_STEP_STATE if structure.drive == "six-step" else ()),
    )


@cache
def parameter_names(structure: Structure) -> tuple[str, ...]:
    """Return the names of the kernel's parameters."""
    return (*control.PARAMETERS, *motion.parameter_names(structure), *PARAMETERS)


def form(
    of_plant: Callable[[Plant, float], dict[str, Array]],
    drive: str,
    *,
    averaged: bool = True,
    printed_eccentricity: bool = False,
) -> Form:
    """Return the form of a model with one winding for a kind of `drive`.

    `of_plant` returns the kernel's parameters. If `averaged`, the current follows its reference as far as the
    supply can drive it within a step; otherwise the sign of the current error switches the full supply
    voltage. `printed_eccentricity` selects the thesis's factor for the monitor model instead of the
    eccentricity of the reference model.
    """

    def advance(structure: Structure) -> Callable[..., Any]:
        if drive == "voltage":
            return _advance_by_voltage(structure)
        return _advance(structure, current_loop(structure, averaged=averaged), printed_eccentricity)

    by_voltage = drive == "voltage"
    return Form(
        channels=BY_VOLTAGE if by_voltage else CHANNELS,
        observable=BY_VOLTAGE[:5] if by_voltage else OBSERVABLE,
        parameters=of_plant,
        initial_state=initial_state,
        state_names=state_names,
        parameter_names=parameter_names,
        advance=advance,
        neutral=control.NEUTRAL | motion.NEUTRAL,
    )


def _advance(
    structure: Structure, current_after: Callable[..., Any], printed_eccentricity: bool
) -> Callable[..., Any]:
    """Return the step of an actuator whose drive controls the current of the conducting pair."""
    demand_of, driven = control.control(structure), motion.driven_motion(structure)
    flux_of, against = _losses(structure)
    gaps = _printed_gaps if printed_eccentricity else _gaps
    pair = conducting_pair(structure)
    shaped = _shaped if structure.emf_shape or structure.commutation else _trapezoidal
    swing_of = _swing(pair) if structure.drive == "six-step" else _no_swing
    supply_of, bus_after = (
        (_sagging_supply, _bus_state) if structure.source else (_stiff_supply, _no_bus_state)
    )

    def advance(s: Any, p: Any, u: Any) -> Any:
        reference, controlled = demand_of(s, p, u)
        fluxes = shaped(s, p, gaps(s, p) * Phases.of(p, "flux"))
        flux = flux_of(s, p, pair.mean(s, p, u.step, fluxes.of_pairs()))
        conductance = pair.mean(s, p, u.step, Phases.of(p, "conductance"))
        decay = pair.mean(s, p, u.step, Phases.of(p, "decay"))
        supply, back_emf = supply_of(s, p), against(s, p, flux * s.speed)
        current, sensed, voltage, own = current_after(
            s, p, u, reference, supply, back_emf, conductance, decay
        )
        torque, following = driven(s, p, u, flux * current, swing_of(s, p, u, flux, supply))
        outputs = (
            pair.shown(s, p, u.step, sensed),
            voltage,
            *motion.recorded_motion(s, p, u, following),
            torque,
            reference,
        )
        own = (torque, current, *bus_after(voltage, current, supply), *own)
        return controlled + following + own, outputs

    return advance


def _advance_by_voltage(structure: Structure) -> Callable[..., Any]:
    """Return the step of a DC motor whose drive sets the duty cycle; no current while the drive is off."""
    demand_of, driven = control.control(structure), motion.driven_motion(structure)
    flux_of, against = _losses(structure)
    supply_of = _supply_under_duty if structure.source else _stiff_supply_under_duty

    def advance(s: Any, p: Any, u: Any) -> Any:
        duty, controlled = demand_of(s, p, u)
        duty = u.enabled * duty
        flux = flux_of(s, p, p.flux_a + p.flux_b)
        back_emf = against(s, p, flux * s.speed)
        voltage = duty * supply_of(s, p, duty, back_emf)
        current = u.enabled * winding_current(s.current, voltage - back_emf, p.conductance_a, p.decay_a)
        torque, following = driven(s, p, u, flux * current)
        position, speed, angle = motion.recorded_motion(s, p, u, following)
        outputs = (current, voltage, position, speed, duty, angle, torque)
        return controlled + following + (torque, current), outputs

    return advance


def _swing(pair: ConductingPair) -> Callable[..., Any]:
    """Return the amplitude of the torque ripple by PWM, a function of (s, p, u, flux, supply)."""

    def swing(s: Any, p: Any, u: Any, flux: Any, supply: Any) -> Any:
        per_volt = pair.of_idle(s, p, Phases.of(p, "half_ripple"))
        return u.enabled * np.abs(flux) * half_ripple(supply, s.voltage / supply, per_volt)

    return swing


def _no_swing(s: Any, p: Any, u: Any, flux: Any, supply: Any) -> Any:  # noqa: ARG001
    return None


def _losses(structure: Structure) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return the functions for the saturated flux, and for the back-EMF plus the inverter's voltage drop.

    They are functions of (state, parameters, flux) and of (state, parameters, back-EMF).
    """
    return (
        _saturated if structure.saturation else _unsaturated,
        _with_drop if structure.voltage_drop else _back_emf,
    )


def _trapezoidal(s: Any, p: Any, fluxes: Any) -> Any:  # noqa: ARG001
    return fluxes


def _shaped(s: Any, p: Any, fluxes: Any) -> Any:
    # The current of the pair carries the sign, so the shapes enter by their magnitude.
    return np.abs(emf_shape(phase_angles(s.electrical), p.flat_loss, p.sine_share)) * fluxes


def _unsaturated(s: Any, p: Any, flux: Any) -> Any:  # noqa: ARG001
    return flux


def _saturated(s: Any, p: Any, flux: Any) -> Any:
    return flux_left(p.saturation, s.current) * flux


def _back_emf(s: Any, p: Any, back_emf: Any) -> Any:  # noqa: ARG001
    return back_emf


def _with_drop(s: Any, p: Any, back_emf: Any) -> Any:
    return back_emf + voltage_drop(s.current, p.drop, p.per_knee)


def _stiff_supply_under_duty(s: Any, p: Any, duty: Any, back_emf: Any) -> Any:  # noqa: ARG001
    return p.supply


def _supply_under_duty(s: Any, p: Any, duty: Any, back_emf: Any) -> Any:
    return supply_under_duty(
        p.supply, p.source_resistance, duty, s.current, back_emf, p.conductance_a, p.decay_a
    )


def _gaps(s: Any, p: Any) -> Any:
    return gap_factors(s.cos, s.sin, p.z_cos, p.z_sin)


def _printed_gaps(s: Any, p: Any) -> Any:
    return printed_factor(np.cos(s.electrical), np.sin(s.electrical), p.z_cos, p.z_sin)


def _stiff_supply(s: Any, p: Any) -> Any:  # noqa: ARG001
    return p.supply


def _sagging_supply(s: Any, p: Any) -> Any:
    return sagging_supply(p.supply, p.source_resistance, s.bus_current)


def _no_bus_state(voltage: Any, current: Any, supply: Any) -> Any:  # noqa: ARG001
    return ()


def _bus_state(voltage: Any, current: Any, supply: Any) -> Any:
    return (voltage * current / supply,)  # the inverter passes on the winding's power without loss
