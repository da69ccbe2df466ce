"""Text of a unit's history for a terminal."""

from typing import Any


def unit_text(values: dict[str, Any]) -> str:
    """Return the blocks of a unit (`emaphm.history.blocks.unit_blocks`) as text, ordered by hours."""
    unit, position = values["unit"], values["unit"]["position"] or "not known"
    lines = [
        f"{unit['serial_number']}, part number {unit['part_number']}, position {position}",
        *_by_hours(values),
        *(_withdrawal(entry) for entry in values["withdrawals"]),
        *_newest_notes(values["diagnoses"][-1]),
        *(f"Note: {note}." for note in values["notes"]),
        *([_prognosis(values)] if values["prognostic_assessment"] else []),
    ]
    return "\n".join(lines)


def named(withdrawal: dict[str, Any]) -> str:
    """Return the kind and name of a withdrawn entry."""
    return f"{withdrawal['kind']} '{withdrawal['subject']}'"


def number(value: int | None) -> str:
    """Return a count as text, or a dash if it is unknown."""
    return "–" if value is None else str(value)


def _by_hours(values: dict[str, Any]) -> list[str]:
    """Return the table of diagnoses, with removals and findings inserted by hours."""
    from emaphm.text_table import format_table

    header = ("hours", "cycles", "recording", "explained", "degraded")
    table = format_table(header, [_row(diagnosis) for diagnosis in values["diagnoses"]]).splitlines()
    dated = [
        *zip((diagnosis["hours"] for diagnosis in values["diagnoses"]), table[2:], strict=True),
        *((removal["hours"], _removal(removal)) for removal in values["removals"]),
        *((finding["hours"], _finding(finding)) for finding in values["findings"]),
    ]
    # At equal hours: flight, then removal, then finding; sorting is stable.
    return [*table[:2], *(line for _, line in sorted(dated, key=lambda entry: entry[0]))]


def _row(diagnosis: dict[str, Any]) -> tuple[str, ...]:
    """Return a diagnosis as a row of text, with the estimates of the degraded components."""
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


def _removal(entry: dict[str, Any]) -> str:
    return f"  removed at {entry['hours']:.9g} h: {entry['reason']}{_in_brackets(entry['note'])}"


def _finding(entry: dict[str, Any]) -> str:
    level = "" if entry["level"] is None else f", level {entry['level']:g}"
    replaced = ", replaced" if entry["replaced"] else ""
    result = f"{entry['component']} {entry['condition']}{level}{replaced}"
    return f"  found at {entry['hours']:.9g} h: {result}{_in_brackets(entry['note'])}"


def _in_brackets(note: str) -> str:
    return f" ({note})" if note else ""


def _withdrawal(entry: dict[str, Any]) -> str:
    return f"withdrawn on {entry['at']}: {named(entry)} at {entry['hours']:.9g} h ({entry['reason']})"


def _newest_notes(diagnosis: dict[str, Any]) -> list[str]:
    """Return the reasons why the newest recording is not explained, and the notes on it."""
    recording = diagnosis["data_manipulation"]["recording"]
    reasons = diagnosis["state_detection"].get("reasons", [])
    return [
        *(f"{recording} is not explained: {reason}." for reason in reasons),
        *(f"Note on {recording}: {note}." for note in diagnosis["data_manipulation"].get("notes", [])),
    ]


def _prognosis(values: dict[str, Any]) -> str:
    """Return the last stored prognosis as a line of text."""
    from emaphm.prognosis.advice import advice_in_words
    from emaphm.prognosis.notes.life import without_rate

    made, advised = values["prognostic_assessment"], values["advisory_generation"]
    median = made["rul_hours"]["median"]
    life = "no failure in sight" if median is None else f"remaining useful life {median:,.0f} h"
    # Older versions did not store the number of flights.
    life += without_rate(made["diagnoses"].get("flights", made["diagnoses"]["used"]))
    if made.get("failed_at_hours") is not None:
        life = f"no remaining useful life, failed at {made['failed_at_hours']:,.9g} h"
    old = ", out of date" if made["out_of_date"] else ""
    advice = advice_in_words(advised)
    return f"prognosis of {made['made_at']} at {made['hours']:.9g} h{old}: {life}; {advice}"
