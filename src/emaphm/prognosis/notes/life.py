"""Notes on a remaining useful life: how much is known of it, and which requirements end it, or never do."""

import math

import numpy as np

from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.prognosis.evidence import Evidence
from emaphm.prognosis.prior import Prior
from emaphm.prognosis.requirements import Requirements
from emaphm.prognosis.requirements.failure_times import FailureTimes

ENOUGH = 3
"""Explained diagnoses from which on a rate is seen rather than assumed: two give one that nothing checks."""


def without_rate(used: int) -> str:
    """Return what is to be said next to a remaining useful life from `used` explained diagnoses, if any."""
    return f", mostly by the prior: {used} of {ENOUGH} explained diagnoses" if used < ENOUGH else ""


def life_notes(
    evidence: Evidence, requirements: Requirements, times: FailureTimes, prior: Prior
) -> list[str]:
    """Return what a prognosis by little evidence, or by odd requirements, leaves open."""
    notes: list[str] = []
    used, kept = len(evidence.used), len(evidence.observations)
    if used < ENOUGH:
        fleet = "one other unit says" if prior.units == 1 else f"{prior.units} other units say"
        of_any = "the general prior says of any unit: the more limits, the earlier"
        notes.append(
            f"explained diagnoses: {used}; {ENOUGH} are needed to see a rate, until then remaining useful "
            f"life, risk and advice are mostly what {of_any if prior.fleet is None else fleet}"
        )
    if kept > used:
        newest = "" if evidence.unexplained is None else ", the newest among them"
        notes.append(f"{kept - used} of {kept} diagnoses are not explained and not used{newest}")
    if not requirements.stated:
        notes.append(
            "the actuator states no [[requirements]]: a failure is taken to be a level of 1, the end of scale"
        )
    hidden = [name for name, seen in zip(CARTESIAN_NAMES, evidence.seen, strict=True) if not seen]
    if hidden:
        notes.append(f"never seen by a diagnosis, and taken as healthy: {', '.join(hidden)}")
    violated = [
        limit.label for limit, row in zip(times.limits, times.hours, strict=True) if np.median(row) == 0
    ]
    if violated:
        notes.append(f"violated already: {', '.join(violated)}")
    never = [
        limit
        for limit, row in zip(times.limits, times.hours, strict=True)
        if (limit.component is None or limit.holds_always) and not np.isfinite(row).any()
    ]
    harmless = [limit.label for limit in never if not requirements.can_fail(limit)]
    if harmless:
        notes.append(f"no single fault at the end of its scale violates: {', '.join(harmless)}")
    if math.isinf(float(np.median(times.first))):
        notes.append("no failure in sight in more than half of the forecast paths")
    return notes
