"""Which phase has which short, where the rotor's electrical zero was estimated or nothing shows it."""

from collections.abc import Mapping
from dataclasses import replace

from emaphm.diagnosis.selection.description_errors import suspected_parameters
from emaphm.diagnosis.selection.settings import ROTOR_ZERO
from emaphm.diagnosis.verdict import Estimate
from emaphm.estimation.problem import Problem
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.space.nuisances import BASELINE
from emaphm.estimation.space.parameter_space import SHORTS
from emaphm.recording.schema import PHASES


def undecided_between_phases(components: Mapping[str, Estimate], result: SearchResult) -> dict[str, Estimate]:
    """Return the `components` of `result`; where the rotor's zero was estimated, no short is any one phase's.

    A sixth of a turn more, and a is what b was, b what c was, c what a was: all three explain the recording.
    A verdict that they share is kept.
    """
    if BASELINE + ROTOR_ZERO not in suspected_parameters(result):
        return dict(components)
    shorts = [components[name] for name in SHORTS]
    share_a_verdict = len({one.verdict for one in shorts}) == 1
    interval = min(one.interval95[0] for one in shorts), max(one.interval95[1] for one in shorts)
    values = ", one ".join(f"{one.value:.3f}" for one in sorted(shorts, key=lambda one: -one.value))
    reason = f"one phase has {values}: which has which is open, as the rotor's zero was estimated"
    open_phases = {
        name: replace(components[name], interval95=interval)
        if share_a_verdict
        else replace(components[name], interval95=interval, verdict="cannot tell", reason=reason)
        for name in SHORTS
    }
    direction = replace(
        components["eccentricity_phase"],
        interval95=(0.0, 1.0),
        identifiable=False,
        verdict="cannot tell",
        reason="it counts from the rotor's electrical zero, which was estimated",
    )
    return {**components, **open_phases, "eccentricity_phase": direction}


def phases_as_described(components: Mapping[str, Estimate], problem: Problem) -> tuple[str, ...]:
    """Return a note where nothing but the described `rotor_zero` says which phase a short is in.

    A motor with sinusoidal back-EMF moves alike whatever its electrical zero is. By one 1 rad off, a short of
    0.15 in phase b was 0.02 in b and 0.16 in c, by one 2.6 rad off it was halved between two phases.
    """
    actuator = problem.actuator
    shown = all(name in problem.measured for name in PHASES)
    degraded = any(components[name].verdict == "degraded" for name in (*SHORTS, "eccentricity"))
    if actuator.electrical is None or actuator.drive_kind != "foc" or shown or not degraded:
        return ()
    note = (
        f"which phase is which rests on rotor_zero ({actuator.electrical.rotor_zero:g} rad) in [electrical], "
        "which recordings behind field-oriented control do not show: unless it was measured, a short may be "
        "in another phase, or in one where two are named"
    )
    return (note,)
