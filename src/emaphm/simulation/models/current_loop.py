"""Current loops of one equivalent winding, with the current sensor of the drive.

Each loop is a function of (state, parameters, input, reference, supply, back-EMF, conductance, decay). It
returns the current after the step, the output of the sensor, the mean voltage, and its own next state.
"""

from collections.abc import Callable
from typing import Any

from emaphm.simulation.engine.structure import Structure
from emaphm.simulation.laws.current_control import limited_pi
from emaphm.simulation.laws.equivalent_winding import mean_voltage, winding_current
from emaphm.simulation.laws.idle_leg import outgoing_after
from emaphm.simulation.laws.lag import approach
from emaphm.simulation.laws.phases import Phases
from emaphm.simulation.laws.pulse_width import delayed
from emaphm.simulation.laws.select import clip, select
from emaphm.simulation.models.conducting_pair import NUMBERS, ConductingPair, conducting_pair


def current_loop(structure: Structure, *, averaged: bool) -> Callable[..., Any]:
    """Return the current loop of an actuator's drive, averaged or switched."""
    loop = _loop_without_sensor(structure, averaged=averaged)
    return _with_lagging_sensor(loop) if structure.current_lag else _with_exact_sensor(loop)


def _loop_without_sensor(structure: Structure, *, averaged: bool) -> Callable[..., Any]:
    """Return the loop without its sensor.

    The function has the output of the sensor at the start of the step as an additional argument, after the
    reference. It returns the current, the mean voltage, and its own next state.
    """
    if not averaged:
        return _switched
    if structure.drive == "six-step":
        return _sampled_loop(conducting_pair(structure))
    return _following_lagging if structure.current_lag else _following


def _with_exact_sensor(loop: Callable[..., Any]) -> Callable[..., Any]:
    def sensed(s: Any, p: Any, u: Any, reference: Any, *winding: Any) -> Any:
        current, voltage, own = loop(s, p, u, reference, s.current, *winding)
        return current, current, voltage, own

    return sensed


def _with_lagging_sensor(loop: Callable[..., Any]) -> Callable[..., Any]:
    def sensed(s: Any, p: Any, u: Any, reference: Any, *winding: Any) -> Any:
        current, voltage, own = loop(s, p, u, reference, s.sensed, *winding)
        shown = approach(s.sensed, current, p.sensed_share)
        return current, shown, voltage, (shown, *own)

    return sensed


def _switched(
    s: Any,
    p: Any,  # noqa: ARG001
    u: Any,
    reference: Any,
    shown: Any,
    supply: Any,
    back_emf: Any,
    conductance: Any,
    decay: Any,
) -> Any:
    side = select(reference > shown, 1.0, select(reference < shown, -1.0, 0.0))
    current = u.enabled * winding_current(s.current, side * supply - back_emf, conductance, decay)
    return current, u.enabled * mean_voltage(s.current, current, back_emf, conductance, decay), ()


def _following(
    s: Any,
    p: Any,  # noqa: ARG001
    u: Any,
    reference: Any,
    shown: Any,  # noqa: ARG001
    supply: Any,
    back_emf: Any,
    conductance: Any,
    decay: Any,
) -> Any:
    lowest = winding_current(s.current, -supply - back_emf, conductance, decay)
    highest = winding_current(s.current, supply - back_emf, conductance, decay)
    current = u.enabled * clip(reference, lowest, highest)
    return current, u.enabled * mean_voltage(s.current, current, back_emf, conductance, decay), ()


def _following_lagging(s: Any, p: Any, u: Any, reference: Any, shown: Any, *winding: Any) -> Any:
    # The drive controls the output of the sensor to the reference. The effect of the comparators' delay on
    # the mean is neglected: with three legs it differs in size, and sometimes in sign, from that of one leg.
    target = reference + p.sensed_lead * (reference - shown)
    return _following(s, p, u, target, shown, *winding)


def _sampled_loop(pair: ConductingPair) -> Callable[..., Any]:
    """Return the sampled current loop of a six-step drive, with the delay of `pulse_width.delay_shares`."""

    def controlled(
        s: Any,
        p: Any,
        u: Any,
        reference: Any,
        shown: Any,
        supply: Any,
        back_emf: Any,
        conductance: Any,
        decay: Any,
    ) -> Any:
        error = reference - pair.shown(s, p, u.step, shown)
        demanded, integral = limited_pi(
            error, s.current_integral, p.current_gain, p.current_integral_gain, supply, u.step
        )
        voltage, lagging = delayed(s.voltage, demanded, p.voltage_share, p.voltage_at_once)
        idle, winding = pair.of_idle(s, p, NUMBERS), Phases.of(p, "winding")
        pair_inductance = pair.of_idle(s, p, winding.of_pairs())
        fall = pair.of_idle(s, p, Phases.of(p, "fall"))
        incoming = select(s.idle == NUMBERS.a, winding.a, select(s.idle == NUMBERS.b, winding.b, winding.c))
        share = select(idle == s.idle, s.incoming_share, incoming / pair_inductance)
        before = select(idle == s.idle, s.outgoing, s.current)
        outgoing, loss = outgoing_after(before, 0.5 * supply, 0.5 * back_emf, 0.5 / conductance, fall)
        free = winding_current(s.current, voltage - back_emf, conductance, decay)
        current = u.enabled * (free - share * loss)
        own = (u.enabled * integral, u.enabled * lagging, u.enabled * outgoing, share, idle)
        return current, u.enabled * voltage, own

    return controlled
