"""Notes on a remaining useful life: its evidence, and requirements that are violated or cannot fail."""

import math

import numpy as np

from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.prognosis.advice import violated_in_words
from emaphm.prognosis.evidence import Evidence
from emaphm.prognosis.prior import Prior
from emaphm.prognosis.requirements import Requirements
from emaphm.prognosis.requirements.failure_times import FailureTimes

ENOUGH = 3
"""Flights with an explained diagnosis needed to estimate a rate: the rate from two cannot be checked.

An indicator needs as many readings.
"""


def without_rate(flights: int) -> str:
    """Return the text added to a remaining useful life from diagnoses of too few `flights`, or ""."""
    if flights >= ENOUGH:
        return ""
    return f", mostly from the prior: explained diagnoses of {flights} of {ENOUGH} flights"


def life_notes(
    evidence: Evidence, requirements: Requirements, times: FailureTimes, prior: Prior
) -> list[str]:
    """Return notes on little evidence, unusual requirements, and the failures in the forecast."""
    notes: list[str] = []
    used, stored = len(evidence.used), len(evidence.observations)
    if evidence.flights < ENOUGH:
        fleet = "one other unit" if prior.units == 1 else f"{prior.units} other units"
        general = "the general prior, according to which more limits mean an earlier failure"
        notes.append(
            f"flights with an explained diagnosis: {evidence.flights}; {ENOUGH} are needed to estimate a "
            "rate, until then remaining useful life, risk and advice mostly follow from "
            f"{general if prior.fleet is None else fleet}"
        )
    if stored > used:
        newest = "" if evidence.unexplained is None else ", the newest among them"
        notes.append(f"{stored - used} of {stored} diagnoses are not explained and not used{newest}")
    if not requirements.stated:
        notes.append(
            "the actuator states no [[requirements]]: a failure is assumed at a level of 1, the end of the "
            "scale"
        )
    undiagnosed = [name for name, seen in zip(CARTESIAN_NAMES, evidence.seen, strict=True) if not seen]
    if undiagnosed:
        notes.append(f"not estimated by any diagnosis, and assumed to be healthy: {', '.join(undiagnosed)}")
    for limit, row in zip(times.limits, times.hours, strict=True):
        if np.median(row) == 0:
            notes.append(f"{violated_in_words(float(np.mean(row == 0)))}: {limit.label}")
    without_failure = [
        limit
        for limit, row in zip(times.limits, times.hours, strict=True)
        if (limit.component is None or limit.holds_always) and not np.isfinite(row).any()
    ]
    harmless = [limit.label for limit in without_failure if not requirements.can_fail(limit)]
    if harmless:
        notes.append(f"no single fault at the end of its scale violates: {', '.join(harmless)}")
    if math.isinf(float(np.median(times.first))):
        notes.append("no failure in sight in more than half of the forecast paths")
    return notes
