"""Notes on shop findings and replacements that contradict the diagnoses of a unit."""

from collections.abc import Sequence

import numpy as np

from emaphm.actuator.faults import COMPONENTS, HEALTHY, NAMES
from emaphm.history.kept_diagnosis import KeptDiagnosis
from emaphm.history.records import UNIT, Finding

SIGNIFICANT = 4.0
"""Standard errors of a diagnosis by which a measured level is off it, from which on a note says so."""

WORTH_SAYING = 0.05
"""And its distance at least: how well a shop measures is not known."""

FASTER = 3.0
"""Multiple of its mean rate at which a level may have gone on between a diagnosis and a finding.

On made-up wear of twelve ways, 1 % of right findings have a note, and 96 % of those that are off by 0.2.
"""

KEPT_SHARE = 0.5
"""Share of a component's distance from healthy that a replacement leaves, from which on a note says so."""

SOON = 0.5
"""Share of the hours in which the old part came there, up to which a new one has had no time to do so."""

Diagnoses = Sequence[KeptDiagnosis]


def contradictions(diagnoses: Diagnoses, findings: Sequence[Finding]) -> tuple[str, ...]:
    """Return a note for each of a unit's `findings` that its diagnoses contradict, by hours.

    Compared are the newest explained diagnosis up to the finding, since the component was replaced before,
    and after a replacement the first one. A contradiction is a component found healthy that is called
    degraded, or the reverse; a measured level that is `SIGNIFICANT` standard errors off, more than wear since
    then may make; a replacement after which the component is called degraded as much as before. Both
    sequences are by hours.
    """
    return tuple(note for one in findings for note in contradiction(one, diagnoses, findings))


def contradiction(finding: Finding, diagnoses: Diagnoses, findings: Sequence[Finding]) -> list[str]:
    """Return the notes on one finding, of a unit with these `diagnoses` and `findings`, as above."""
    components = COMPONENTS if finding.component == UNIT else (finding.component,)
    lives = {name: _life(name, finding, diagnoses, findings) for name in components}
    differing = [name for name, life in lives.items() if life and _differs(finding, name, life)]
    # Of a unit that is worn anywhere, it is enough that one of its components is.
    is_any = finding.component == UNIT and finding.condition != "healthy"
    if (is_any and len(differing) < len(COMPONENTS)) or _has_unexplained(finding, diagnoses):
        differing = []
    notes = []
    if differing:
        said = "; ".join(f"{name} {_said(lives[name][-1], name)}" for name in differing)
        counts = "it counts as failed" if finding.condition == "failed" else "forecasts follow the diagnoses"
        level = "" if finding.level is None else f" with a level of {finding.level:g}"
        notes.append(
            f"{finding.component} was found {finding.condition}{level} at {finding.hours:.9g} h, but the "
            f"diagnosis of {lives[differing[0]][-1].hours:.9g} h says: {said}; {counts} all the "
            "same: check both, and record again"
        )
    if finding.replaced:
        notes += [note for name in components for note in _unchanged(name, lives[name], finding, diagnoses)]
    return notes


def _life(name: str, finding: Finding, diagnoses: Diagnoses, findings: Sequence[Finding]) -> Diagnoses:
    """Return the explained diagnoses up to a finding, since a component was replaced before it."""
    before = [
        one.hours
        for one in findings
        if one.replaced and one.component in (name, UNIT) and one.hours < finding.hours
    ]
    start = max(before, default=-np.inf)
    return [one for one in diagnoses if one.explained and start < one.hours <= finding.hours]


def _has_unexplained(finding: Finding, diagnoses: Diagnoses) -> bool:
    """Return whether the newest diagnosis explains nothing, so that a fault may have come meanwhile."""
    before = [one for one in diagnoses if one.hours <= finding.hours]
    return bool(before) and not before[-1].explained and finding.condition != "healthy"


def _differs(finding: Finding, name: str, life: Diagnoses) -> bool:
    """Return whether the newest diagnosis of a component contradicts a finding on it."""
    verdict = life[-1].verdicts[name]
    if verdict == ("degraded" if finding.condition == "healthy" else "healthy"):
        return True
    if finding.level is None:
        return False
    first, newest = (_level(one, name) for one in (life[0], life[-1]))
    span, since = life[-1].hours - life[0].hours, finding.hours - life[-1].hours
    worn = FASTER * abs(newest - first) * since / span if span > 0 else 0.0
    error = float(life[-1].standard_errors[NAMES.index(name)])
    return abs(finding.level - newest) > max(SIGNIFICANT * error, WORTH_SAYING) + worn


def _unchanged(name: str, life: Diagnoses, finding: Finding, diagnoses: Diagnoses) -> list[str]:
    """Return a note where a component is called degraded as much after its replacement as before."""
    later = [one for one in diagnoses if one.explained and one.hours > finding.hours]
    if not life or not later:
        return []
    before, after = life[-1], later[0]
    healthy = float(HEALTHY.vector[NAMES.index(name)])
    left = abs(_level(after, name) - healthy) / max(abs(_level(before, name) - healthy), 1e-9)
    soon = after.hours - finding.hours <= SOON * (finding.hours - min(life[0].hours, finding.hours))
    if left < KEPT_SHARE or not soon or {before.verdicts[name], after.verdicts[name]} != {"degraded"}:
        return []
    note = (
        f"{name} was replaced at {finding.hours:.9g} h, but the diagnosis of {after.hours:.9g} h says: "
        f"{_said(after, name)}, after {_level(before, name):.3f} before: another part may cause it, or the "
        "description may be wrong; forecasts take it for new until a second diagnosis agrees"
    )
    return [note]


def _level(diagnosis: KeptDiagnosis, name: str) -> float:
    return float(diagnosis.vector[NAMES.index(name)])


def _said(diagnosis: KeptDiagnosis, name: str) -> str:
    """Return level, interval and verdict of a component in a diagnosis, in words."""
    low, high = diagnosis.document["faults"][name]["interval95"]
    level, verdict = _level(diagnosis, name), diagnosis.verdicts[name]
    return f"{level:.3f} (95 %: {low:.3f} to {high:.3f}), {verdict}"
