"""The models with one equivalent winding: the monitor model, and the averaged model of all drives but one.

The two conducting phases of the rotor's sector are one winding. Its rows come from three pairs of
phases, each named by the phase that idles: pair a is b with c, and so on. A DC motor has one winding.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from emaphm.arrays import Array
from emaphm.simulation.engine.inputs import Inputs
from emaphm.simulation.engine.model import OBSERVABLE, Form, Initial
from emaphm.simulation.engine.plant import Plant
from emaphm.simulation.engine.structure import Structure
from emaphm.simulation.laws.angles import phase_angles
from emaphm.simulation.laws.commutation import of_idle_phase
from emaphm.simulation.laws.current_control import limited_pi
from emaphm.simulation.laws.eccentricity import gap_factors, printed_factor
from emaphm.simulation.laws.emf_shape import emf_shape
from emaphm.simulation.laws.equivalent_winding import mean_voltage, winding_current
from emaphm.simulation.laws.idle_leg import outgoing_after
from emaphm.simulation.laws.lag import approach, share_of_step
from emaphm.simulation.laws.phases import Phases, by_phase, phase_names
from emaphm.simulation.laws.pulse_width import delay_shares, delayed
from emaphm.simulation.laws.saturation import flux_left
from emaphm.simulation.laws.select import clip, select
from emaphm.simulation.laws.supply_source import sagging_supply, supply_under_duty
from emaphm.simulation.laws.voltage_drop import knees_per_ampere, voltage_drop
from emaphm.simulation.models import control, motion

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
    "drop",
    "per_knee",
    "current_gain",
    "current_integral_gain",
    "voltage_share",
    "voltage_at_once",
    *phase_names("winding"),
    *phase_names("fall"),
)


def of_pairs(turns: Array) -> Array:
    """Return for each phase, (3, n), the sum of the other two, which conduct while it idles."""
    return np.stack([*Phases(*turns).of_pairs()])


def parameters(
    plant: Plant, step: float, pair_turns: Array, pair_squares: Array, phase_turns: Array
) -> dict[str, Array]:
    """Return the kernel's parameters for `plant` at `step` [s], (n,) each.

    `pair_turns` (3, n) scales each pair's resistance, `pair_squares` (3, n) its inductance, and
    `phase_turns` (3, n) each phase's share of the torque constant, all 1 when healthy.
    """
    resistance, inductance = plant.resistance * pair_turns, plant.inductance * pair_squares
    sensed_share = share_of_step(plant.current_lag, step)
    windings = plant.inductance / 2 * plant.turns**2
    falls = step * (1 - 1 / (windings * (1 / windings).sum(axis=0))) / windings
    share, at_once = delay_shares(plant.pwm_frequency, step)
    rows = {
        "supply": plant.supply,
        **by_phase("conductance", 1 / resistance),
        **by_phase("decay", np.exp(-step * resistance / inductance)),
        **by_phase("flux", plant.torque_constant / 2 * phase_turns),
        "z_cos": plant.z[0],
        "z_sin": plant.z[1],
        **by_phase("winding", windings),
        **by_phase("fall", falls),
        "voltage_share": share,
        "voltage_at_once": at_once,
        "source_resistance": plant.source_resistance,
        "sensed_share": sensed_share,
        "saturation": plant.saturation,
        "flat_loss": plant.flat_loss,
        "sine_share": plant.sine_share,
        "drop": plant.voltage_drop,
        "per_knee": knees_per_ampere(plant.current_limit),
        "sensed_lead": 1 / sensed_share - 1,
        "current_gain": plant.current_gain,
        "current_integral_gain": plant.current_integral_gain,
    }
    return control.parameters(plant, step) | motion.parameters(plant, step) | rows


def initial_state(plant: Plant, inputs: Inputs, start: Initial) -> dict[str, Array]:
    """Return the kernel's state at `start`, (n,) each, without current."""
    own = dict.fromkeys((*OWN_STATE, *SIX_STEP_STATE), np.zeros(plant.count))
    moving = motion.initial_state(plant, start)
    own["idle"] = of_idle_phase(moving["electrical"], NUMBERS)
    return control.initial_state(plant, inputs, start) | moving | own


OWN_STATE = ("torque", "current", "bus_current", "sensed")
"""What winding, supply and sensor may add to the state."""

SIX_STEP_STATE = ("current_integral", "voltage", "outgoing", "incoming_share", "idle")
"""What a six-step drive adds: its controller's integral and lagging voltage, the current that the outgoing
phase still carries, the incoming phase's share of the pair's inductance, and which phase idles."""

NUMBERS = Phases(0.0, 1.0, 2.0)
"""By which a six-step drive's state names the phase that idles."""


def state_names(structure: Structure) -> tuple[str, ...]:
    """Return the kernel's state."""
    return (
        *control.state_names(structure),
        *motion.state_names(structure),
        "torque",
        "current",
        *(("bus_current",) if structure.source and structure.drive != "voltage" else ()),
        *(("sensed",) if structure.current_lag else ()),
        *(SIX_STEP_STATE if structure.drive == "six-step" else ()),
    )


def parameter_names(structure: Structure) -> tuple[str, ...]:
    """Return the kernel's parameters."""
    return (*control.PARAMETERS, *motion.parameter_names(structure), *PARAMETERS)


def form(
    of_plant: Callable[[Plant, float], dict[str, Array]],
    drive: str,
    *,
    averaged: bool = True,
    printed_eccentricity: bool = False,
) -> Form:
    """Return the form of a model with one winding for a kind of `drive`.

    `averaged`: the current follows its reference as far as the supply can force it within a step;
    otherwise the full supply is switched by the sign of the current error. `printed_eccentricity`: the
    thesis's factor for the monitor model instead of the reference model's.
    """

    def advance(structure: Structure) -> Callable[..., Any]:
        if drive == "voltage":
            return _advance_by_voltage(structure)
        return _advance(structure, _current(structure, averaged=averaged), printed_eccentricity)

    by_voltage = drive == "voltage"
    return Form(
        BY_VOLTAGE if by_voltage else CHANNELS,
        BY_VOLTAGE[:5] if by_voltage else OBSERVABLE,
        of_plant,
        initial_state,
        state_names,
        parameter_names,
        advance,
        control.NEUTRAL | motion.NEUTRAL,
    )


def _advance(
    structure: Structure, current_after: Callable[..., Any], printed_eccentricity: bool
) -> Callable[..., Any]:
    """Return the step of an actuator whose drive controls the current of the conducting pair."""
    demand_of, driven = control.control(structure), motion.driven_motion(structure)
    flux_of, against = _losses(structure)
    gaps = _printed_gaps if printed_eccentricity else _gaps
    shaped = _shaped if structure.emf_shape else _trapezoidal
    supply_of, bus_after = (_sagging, _drawn) if structure.source else (_stiff, _nothing_drawn)

    def advance(s: Any, p: Any, u: Any) -> Any:
        reference, controlled = demand_of(s, p, u)
        fluxes = shaped(s, p, gaps(s, p) * Phases.of(p, "flux"))
        flux = flux_of(s, p, of_idle_phase(s.electrical, fluxes.of_pairs()))
        conductance = of_idle_phase(s.electrical, Phases.of(p, "conductance"))
        decay = of_idle_phase(s.electrical, Phases.of(p, "decay"))
        supply, back_emf = supply_of(s, p), against(s, p, flux * s.speed)
        current, sensed, voltage, own = current_after(
            s, p, u, reference, supply, back_emf, conductance, decay
        )
        torque, following = driven(s, p, u, flux * current)
        outputs = (
            sensed,
            voltage,
            *motion.recorded_motion(s, p, u, following),
            torque,
            reference,
        )
        own = (torque, current, *bus_after(voltage, current, supply), *own)
        return controlled + following + own, outputs

    return advance


def _advance_by_voltage(structure: Structure) -> Callable[..., Any]:
    """Return the step of a DC motor whose drive sets the duty cycle; without current where it is off."""
    demand_of, driven = control.control(structure), motion.driven_motion(structure)
    flux_of, against = _losses(structure)
    supply_of = _under_duty if structure.source else _stiff_under_duty

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


def _losses(structure: Structure) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return what the current leaves of a flux, and what the winding has against it for a back-EMF.

    Each of (state, parameters, flux or back-EMF).
    """
    return (
        _saturated if structure.saturation else _unsaturated,
        _with_drop if structure.voltage_drop else _back_emf,
    )


def _trapezoidal(s: Any, p: Any, fluxes: Any) -> Any:  # noqa: ARG001
    return fluxes


def _shaped(s: Any, p: Any, fluxes: Any) -> Any:
    # The current of the pair has the sign: of the shapes only their size counts.
    return np.abs(emf_shape(phase_angles(s.electrical), p.flat_loss, p.sine_share)) * fluxes


def _unsaturated(s: Any, p: Any, flux: Any) -> Any:  # noqa: ARG001
    return flux


def _saturated(s: Any, p: Any, flux: Any) -> Any:
    return flux_left(p.saturation, s.current) * flux


def _back_emf(s: Any, p: Any, back_emf: Any) -> Any:  # noqa: ARG001
    return back_emf


def _with_drop(s: Any, p: Any, back_emf: Any) -> Any:
    return back_emf + voltage_drop(s.current, p.drop, p.per_knee)


def _stiff_under_duty(s: Any, p: Any, duty: Any, back_emf: Any) -> Any:  # noqa: ARG001
    return p.supply


def _under_duty(s: Any, p: Any, duty: Any, back_emf: Any) -> Any:
    return supply_under_duty(
        p.supply, p.source_resistance, duty, s.current, back_emf, p.conductance_a, p.decay_a
    )


def _gaps(s: Any, p: Any) -> Any:
    return gap_factors(s.cos, s.sin, p.z_cos, p.z_sin)


def _printed_gaps(s: Any, p: Any) -> Any:
    return printed_factor(np.cos(s.electrical), np.sin(s.electrical), p.z_cos, p.z_sin)


def _stiff(s: Any, p: Any) -> Any:  # noqa: ARG001
    return p.supply


def _sagging(s: Any, p: Any) -> Any:
    return sagging_supply(p.supply, p.source_resistance, s.bus_current)


def _nothing_drawn(voltage: Any, current: Any, supply: Any) -> Any:  # noqa: ARG001
    return ()


def _drawn(voltage: Any, current: Any, supply: Any) -> Any:
    return (voltage * current / supply,)  # the inverter passes on the winding's power without loss


def _current(structure: Structure, *, averaged: bool) -> Callable[..., Any]:
    """Return how the current loop, averaged or switched, changes the current, and what the sensor shows."""
    if not averaged:
        return _switched_lagging if structure.current_lag else _switched
    if structure.drive == "six-step":
        return _controlled_lagging if structure.current_lag else _controlled
    return _following_lagging if structure.current_lag else _following


def _switched(
    s: Any,
    p: Any,  # noqa: ARG001
    u: Any,
    reference: Any,
    supply: Any,
    back_emf: Any,
    conductance: Any,
    decay: Any,
) -> Any:
    side = _side(reference, s.current)
    current = u.enabled * winding_current(s.current, side * supply - back_emf, conductance, decay)
    return current, current, mean_voltage(s.current, current, back_emf, conductance, decay), ()


def _switched_lagging(
    s: Any, p: Any, u: Any, reference: Any, supply: Any, back_emf: Any, conductance: Any, decay: Any
) -> Any:
    side = _side(reference, s.sensed)
    current = u.enabled * winding_current(s.current, side * supply - back_emf, conductance, decay)
    sensed = approach(s.sensed, current, p.sensed_share)
    return current, sensed, mean_voltage(s.current, current, back_emf, conductance, decay), (sensed,)


def _side(reference: Any, shown: Any) -> Any:
    """Return the side of the supply that is switched on, 1, -1 or 0, by the current that the sensor shows."""
    return select(reference > shown, 1.0, select(reference < shown, -1.0, 0.0))


def _following(
    s: Any,
    p: Any,  # noqa: ARG001
    u: Any,
    reference: Any,
    supply: Any,
    back_emf: Any,
    conductance: Any,
    decay: Any,
) -> Any:
    lowest = winding_current(s.current, -supply - back_emf, conductance, decay)
    highest = winding_current(s.current, supply - back_emf, conductance, decay)
    current = u.enabled * clip(reference, lowest, highest)
    return current, current, mean_voltage(s.current, current, back_emf, conductance, decay), ()


def _following_lagging(
    s: Any, p: Any, u: Any, reference: Any, supply: Any, back_emf: Any, conductance: Any, decay: Any
) -> Any:
    # The drive sees the sensor's current, and brings that to the reference. What the comparators' late turn
    # does to the mean is left out: with three legs it has neither the size nor always the sign of one leg's.
    target = reference + p.sensed_lead * (reference - s.sensed)
    lowest = winding_current(s.current, -supply - back_emf, conductance, decay)
    highest = winding_current(s.current, supply - back_emf, conductance, decay)
    current = u.enabled * clip(target, lowest, highest)
    sensed = approach(s.sensed, current, p.sensed_share)
    return current, sensed, mean_voltage(s.current, current, back_emf, conductance, decay), (sensed,)


def _controlled(
    s: Any, p: Any, u: Any, reference: Any, supply: Any, back_emf: Any, conductance: Any, decay: Any
) -> Any:
    error = reference - s.current
    current, voltage, own = _driven(s, p, u, error, supply, back_emf, conductance, decay)
    return current, current, voltage, own


def _controlled_lagging(
    s: Any, p: Any, u: Any, reference: Any, supply: Any, back_emf: Any, conductance: Any, decay: Any
) -> Any:
    error = reference - s.sensed
    current, voltage, own = _driven(s, p, u, error, supply, back_emf, conductance, decay)
    sensed = approach(s.sensed, current, p.sensed_share)
    return current, sensed, voltage, (sensed, *own)


def _driven(
    s: Any, p: Any, u: Any, error: Any, supply: Any, back_emf: Any, conductance: Any, decay: Any
) -> Any:
    demanded, integral = limited_pi(
        error, s.current_integral, p.current_gain, p.current_integral_gain, supply, u.step
    )
    voltage, lagging = delayed(s.voltage, demanded, p.voltage_share, p.voltage_at_once)
    idle, winding = of_idle_phase(s.electrical, NUMBERS), Phases.of(p, "winding")
    pair = of_idle_phase(s.electrical, winding.of_pairs())
    fall = of_idle_phase(s.electrical, Phases.of(p, "fall"))
    incoming = select(s.idle == NUMBERS.a, winding.a, select(s.idle == NUMBERS.b, winding.b, winding.c))
    share = select(idle == s.idle, s.incoming_share, incoming / pair)
    before = select(idle == s.idle, s.outgoing, s.current)
    outgoing, taken = outgoing_after(before, 0.5 * supply, 0.5 * back_emf, 0.5 / conductance, fall)
    driven = winding_current(s.current, voltage - back_emf, conductance, decay)
    current = u.enabled * (driven - share * taken)
    own = (u.enabled * integral, u.enabled * lagging, u.enabled * outgoing, share, idle)
    return current, u.enabled * voltage, own
