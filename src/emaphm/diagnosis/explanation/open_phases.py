"""Assignment of shorts to phases if the rotor's electrical zero was estimated or is not identifiable."""

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
    """Return the `components` of `result`; shorts are undecided if the rotor's zero was estimated.

    With a zero a sixth of a turn more, the phases a, b, c are the former b, c, a, and the recording is
    explained equally well. A common verdict of the three shorts is kept.
    """
    if BASELINE + ROTOR_ZERO not in suspected_parameters(result):
        return dict(components)
    shorts = [components[name] for name in SHORTS]
    have_common_verdict = len({short.verdict for short in shorts}) == 1
    interval = min(short.interval95[0] for short in shorts), max(short.interval95[1] for short in shorts)
    values = ", ".join(f"{short.value:.3f}" for short in sorted(shorts, key=lambda short: -short.value))
    reason = f"the phases have shorts of {values} in unknown order, because the rotor's zero was estimated"
    open_phases = {
        name: replace(components[name], interval95=interval)
        if have_common_verdict
        else replace(components[name], interval95=interval, verdict="cannot tell", reason=reason)
        for name in SHORTS
    }
    direction = replace(
        components["eccentricity_phase"],
        interval95=(0.0, 1.0),
        identifiable=False,
        verdict="cannot tell",
        reason="its reference is the rotor's electrical zero, which was estimated",
    )
    return {**components, **open_phases, "eccentricity_phase": direction}


def phases_as_described(components: Mapping[str, Estimate], problem: Problem) -> tuple[str, ...]:
    """Return a note if the phase of a short depends on the described `rotor_zero` alone.

    The motion of a motor with sinusoidal back-EMF does not depend on its electrical zero. With a zero 1 rad
    off, a short of 0.15 in phase b was estimated as 0.02 in b and 0.16 in c; with a zero 2.6 rad off, it was
    divided equally between two phases.
    """
    actuator = problem.actuator
    are_recorded = all(name in problem.measured for name in PHASES)
    degraded = any(components[name].verdict == "degraded" for name in (*SHORTS, "eccentricity"))
    if actuator.electrical is None or actuator.drive_kind != "foc" or are_recorded or not degraded:
        return ()
    note = (
        f"the assignment of phases rests on rotor_zero ({actuator.electrical.rotor_zero:g} rad) in "
        "[electrical], which recordings behind field-oriented control do not identify: unless it was "
        "measured, a short may be in another phase, or in one phase where two are named"
    )
    return (note,)
