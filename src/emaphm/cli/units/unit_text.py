"""What a history holds of a unit, as text for a terminal."""

from typing import Any


def unit_text(values: dict[str, Any]) -> str:
    """Return the blocks of a unit (`emaphm.history.blocks.unit_blocks`) as text, all of it by hours."""
    about, position = values["unit"], values["unit"]["position"] or "not known"
    lines = [
        f"{about['serial_number']}, part number {about['part_number']}, position {position}",
        *_by_hours(values),
        *(_withdrawn(one) for one in values["withdrawals"]),
        *_said_of_newest(values["diagnoses"][-1]),
        *(f"Note: {note}." for note in values["notes"]),
        *([_assessed(values)] if values["prognostic_assessment"] else []),
    ]
    return "\n".join(lines)


def named(one: dict[str, Any]) -> str:
    """Return what a withdrawal took out, in words."""
    return f"{one['kind']} '{one['subject']}'"


def number(value: int | None) -> str:
    """Return a count as text, a dash where it is not known."""
    return "–" if value is None else str(value)


def _by_hours(values: dict[str, Any]) -> list[str]:
    """Return the table of diagnoses, with removals and findings where they belong."""
    from emaphm.text_table import format_table

    header = ("hours", "cycles", "recording", "explained", "degraded")
    table = format_table(header, [_row(one) for one in values["diagnoses"]]).splitlines()
    dated = [
        *zip((one["hours"] for one in values["diagnoses"]), table[2:], strict=True),
        *((one["hours"], _removed(one)) for one in values["removals"]),
        *((one["hours"], _found(one)) for one in values["findings"]),
    ]
    # At the same hours: flown, then removed, then found; sorting keeps this order.
    return [*table[:2], *(line for _, line in sorted(dated, key=lambda one: one[0]))]


def _row(diagnosis: dict[str, Any]) -> tuple[str, ...]:
    """Return a diagnosis as a row of text, with the estimates of what is degraded."""
    from emaphm.actuator.faults import degraded_in, health_in

    explained, assessed = diagnosis["state_detection"]["explained"], diagnosis["health_assessment"]
    health = health_in({**assessed, "explained": explained})
    degraded = [f"{name} {assessed['faults'][name]['value']:.3f}" for name in degraded_in(assessed)]
    return (
        f"{diagnosis['hours']:.9g}",
        number(diagnosis["cycles"]),
        diagnosis["data_manipulation"]["recording"],
        "yes" if explained else "no",
        ", ".join(degraded) or ("none" if health == "healthy" else "cannot tell"),
    )


def _removed(one: dict[str, Any]) -> str:
    return f"  removed at {one['hours']:.9g} h: {one['reason']}{_noted(one['note'])}"


def _found(one: dict[str, Any]) -> str:
    level = "" if one["level"] is None else f", level {one['level']:g}"
    what = f"{one['component']} {one['condition']}{level}{', replaced' if one['replaced'] else ''}"
    return f"  found at {one['hours']:.9g} h: {what}{_noted(one['note'])}"


def _noted(note: str) -> str:
    return f" ({note})" if note else ""


def _withdrawn(one: dict[str, Any]) -> str:
    return f"withdrawn on {one['at']}: {named(one)} at {one['hours']:.9g} h ({one['reason']})"


def _said_of_newest(diagnosis: dict[str, Any]) -> list[str]:
    """Return why the newest recording is not explained, and the notes on it."""
    recording = diagnosis["data_manipulation"]["recording"]
    reasons = diagnosis["state_detection"].get("reasons", [])
    return [
        *(f"{recording} is not explained: {reason}." for reason in reasons),
        *(f"Note on {recording}: {note}." for note in diagnosis["data_manipulation"].get("notes", [])),
    ]


def _assessed(values: dict[str, Any]) -> str:
    """Return the last kept prognosis as a line of text."""
    from emaphm.prognosis.advice import advice_in_words
    from emaphm.prognosis.notes.life import without_rate

    made, advised = values["prognostic_assessment"], values["advisory_generation"]
    median = made["rul_hours"]["median"]
    lasts = "no failure in sight" if median is None else f"remaining useful life {median:,.0f} h"
    lasts += without_rate(made["diagnoses"]["used"])
    if made.get("failed_at_hours") is not None:
        lasts = f"no remaining useful life, failed at {made['failed_at_hours']:,.9g} h"
    old = ", out of date" if made["out_of_date"] else ""
    what = advice_in_words(advised)
    return f"prognosis of {made['made_at']} at {made['hours']:.9g} h{old}: {lasts}; {what}"
