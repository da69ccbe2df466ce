"""Notes on shop findings and replacements that contradict the diagnoses of a unit."""

from collections.abc import Sequence

import numpy as np

from emaphm.actuator.faults import COMPONENTS, HEALTHY, NAMES
from emaphm.history.kept_diagnosis import KeptDiagnosis
from emaphm.history.records import UNIT, Finding

SIGNIFICANT = 4.0
"""Deviation of a measured level from the diagnosis, in standard errors, from which on there is a note."""

WORTH_SAYING = 0.05
"""Least deviation for a note: the accuracy of a shop's measurement is not known."""

FASTER = 3.0
"""Multiple of its mean rate at which a level may have changed between a diagnosis and a finding.

On synthetic wear with twelve courses, 1 % of correct findings have a note, and 96 % of those with an error of
0.2.
"""

KEPT_SHARE = 0.5
"""Remaining share of a component's distance from healthy after a replacement, from which on there is a
note."""

SOON = 0.5
"""Share of the life of the old part, up to which a new part cannot have reached the same level."""

Diagnoses = Sequence[KeptDiagnosis]


def contradictions(diagnoses: Diagnoses, findings: Sequence[Finding]) -> tuple[str, ...]:
    """Return a note for each of a unit's `findings` that its diagnoses contradict, by hours.

    A finding is compared with the newest explained diagnosis up to its hours in the same life of the
    component, and a replacement with the first explained diagnosis after it. Contradictions are: a component
    found healthy with the verdict degraded, or the reverse; a measured level that deviates by `SIGNIFICANT`
    standard errors plus the possible wear since the diagnosis; a component as degraded after a replacement as
    before. Both sequences are by hours.
    """
    return tuple(note for finding in findings for note in contradiction(finding, diagnoses, findings))


def contradiction(finding: Finding, diagnoses: Diagnoses, findings: Sequence[Finding]) -> list[str]:
    """Return the notes on one finding of a unit, as in `contradictions`."""
    components = COMPONENTS if finding.component == UNIT else (finding.component,)
    lives = {name: _life(name, finding, diagnoses, findings) for name in components}
    differing = [name for name, life in lives.items() if life and _differs(finding, name, life)]
    # A finding that the unit is worn contradicts the diagnoses only if all components are healthy.
    is_any = finding.component == UNIT and finding.condition != "healthy"
    if (is_any and len(differing) < len(COMPONENTS)) or _has_unexplained(finding, diagnoses):
        differing = []
    notes = []
    if differing:
        levels_text = "; ".join(f"{name} {_level_text(lives[name][-1], name)}" for name in differing)
        counts = (
            "it still counts as failed"
            if finding.condition == "failed"
            else "forecasts still follow the diagnoses"
        )
        level = "" if finding.level is None else f" with a level of {finding.level:g}"
        notes.append(
            f"{finding.component} was found {finding.condition}{level} at {finding.hours:.9g} h, but the "
            f"diagnosis of {lives[differing[0]][-1].hours:.9g} h has {levels_text}; {counts}: check both "
            "by another recording, and withdraw the finding ('emaphm history withdraw') if it is wrong"
        )
    if finding.replaced:
        notes += [
            note
            for name in components
            for note in _notes_on_replacement(name, lives[name], finding, diagnoses)
        ]
    return notes


def _life(name: str, finding: Finding, diagnoses: Diagnoses, findings: Sequence[Finding]) -> Diagnoses:
    """Return the explained diagnoses up to a finding, in the same life of a component."""
    before = [
        earlier.hours
        for earlier in findings
        if earlier.replaced and earlier.component in (name, UNIT) and earlier.hours < finding.hours
    ]
    start = max(before, default=-np.inf)
    return [
        diagnosis
        for diagnosis in diagnoses
        if diagnosis.explained and start < diagnosis.hours <= finding.hours
    ]


def _has_unexplained(finding: Finding, diagnoses: Diagnoses) -> bool:
    """Return whether the newest diagnosis is not explained, so that a fault may have occurred since."""
    before = [diagnosis for diagnosis in diagnoses if diagnosis.hours <= finding.hours]
    return bool(before) and not before[-1].explained and finding.condition != "healthy"


def _differs(finding: Finding, name: str, life: Diagnoses) -> bool:
    """Return whether the newest diagnosis of a component contradicts a finding on it."""
    verdict = life[-1].verdicts[name]
    if verdict == ("degraded" if finding.condition == "healthy" else "healthy"):
        return True
    if finding.level is None:
        return False
    first, newest = (_level(diagnosis, name) for diagnosis in (life[0], life[-1]))
    span, hours_since = life[-1].hours - life[0].hours, finding.hours - life[-1].hours
    worn = FASTER * abs(newest - first) * hours_since / span if span > 0 else 0.0
    error = float(life[-1].standard_errors[NAMES.index(name)])
    return abs(finding.level - newest) > max(SIGNIFICANT * error, WORTH_SAYING) + worn


def _notes_on_replacement(name: str, life: Diagnoses, finding: Finding, diagnoses: Diagnoses) -> list[str]:
    """Return a note if a component is about as degraded after its replacement as before."""
    later = [diagnosis for diagnosis in diagnoses if diagnosis.explained and diagnosis.hours > finding.hours]
    if not life or not later:
        return []
    before, after = life[-1], later[0]
    healthy = float(HEALTHY.vector[NAMES.index(name)])
    remaining_share = abs(_level(after, name) - healthy) / max(abs(_level(before, name) - healthy), 1e-9)
    is_soon = after.hours - finding.hours <= SOON * (finding.hours - min(life[0].hours, finding.hours))
    if (
        remaining_share < KEPT_SHARE
        or not is_soon
        or {before.verdicts[name], after.verdicts[name]} != {"degraded"}
    ):
        return []
    note = (
        f"{name} was replaced at {finding.hours:.9g} h, but the diagnosis of {after.hours:.9g} h has "
        f"{_level_text(after, name)}, and {_level(before, name):.3f} before: another part may be the cause, "
        "or the description may be wrong; forecasts take it as new until a second diagnosis agrees"
    )
    return [note]


def _level(diagnosis: KeptDiagnosis, name: str) -> float:
    return float(diagnosis.vector[NAMES.index(name)])


def _level_text(diagnosis: KeptDiagnosis, name: str) -> str:
    """Return level, interval and verdict of a component in a diagnosis as text."""
    low, high = diagnosis.document["faults"][name]["interval95"]
    level, verdict = _level(diagnosis, name), diagnosis.verdicts[name]
    return f"{level:.3f} (95 %: {low:.3f} to {high:.3f}), {verdict}"
