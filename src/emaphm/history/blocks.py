"""A unit's history as JSON, with parts named after the processing blocks of ISO 13374-1.

The rig does the data acquisition; the following blocks are data manipulation, state detection, health
assessment, prognostic assessment and advisory generation. The last two are from the unit's last stored
prognosis (`emaphm prognose --keep`, `emaphm watch`), or null without any.
"""

from typing import Any

from emaphm.history import reading
from emaphm.history.basis import bases
from emaphm.history.entries import UnitEntries
from emaphm.history.kept_diagnosis import KeptDiagnosis
from emaphm.history.kept_prognosis import KeptPrognosis, read_prognosis
from emaphm.history.lives import latest_hours
from emaphm.history.notes.contradictions import contradictions
from emaphm.history.notes.descriptions import description_notes
from emaphm.history.records import FINDABLE
from emaphm.history.storage.tables import UNITS
from emaphm.history.unit import Unit

DATA_MANIPULATION = ("recording", "channels", "notes")
"""Keys on the processing of the recording's channels."""

STATE_DETECTION = ("explained", "reasons", "moves", "residual_rms_A", "laws", "sensor_faults", "detector")
"""Keys on the agreement of the recording with the described actuator."""

METHOD = (
    "method",
    "model",
    "fitness",
    "fitness_name",
    "evaluations",
    "reference_runs",
    "seconds",
    "seed",
    "version",
)
"""Keys on the method."""


def diagnosis_blocks(diagnosis: KeptDiagnosis) -> dict[str, Any]:
    """Return a diagnosis in blocks; each key of `emaphm diagnose --json` is in exactly one block."""
    document = diagnosis.document
    data_manipulation = {"recording_hash": diagnosis.recording_hash, **_taken(document, DATA_MANIPULATION)}
    data_manipulation["recording"] = diagnosis.recording
    return {
        "hours": diagnosis.flight.hours,
        "cycles": diagnosis.flight.cycles,
        "position": diagnosis.flight.position,
        "added_at": diagnosis.added_at,
        "data_manipulation": data_manipulation,
        "state_detection": _taken(document, STATE_DETECTION),
        # All other keys are on the faults, including those of later versions.
        "health_assessment": {
            key: value
            for key, value in document.items()
            if key not in (*DATA_MANIPULATION, *STATE_DETECTION, *METHOD)
        },
        "settings": {"description": diagnosis.settings.description, **_taken(document, METHOD)},
    }


def unit_blocks(unit: Unit) -> dict[str, Any]:
    """Return a unit's entries and last stored prognosis in blocks; `HistoryError` if it was withdrawn."""
    with unit.database.reading() as connection:  # one consistent state
        # Read again: after a withdrawal, its id may be that of another unit.
        row = reading.unit(connection, unit.serial_number)
        entries = UnitEntries.read(connection, row.id, row.serial_number)
        diagnoses = reading.diagnoses(connection, row.id)
        prognosis = read_prognosis(connection, row.id)
        basis = bases(connection, UNITS.c.id == row.id)[row.id]
        differences = description_notes(connection, row)
    last = entries.flights[-1]
    is_removed = any(removal.hours >= last.hours for removal in entries.removals)
    return {
        "unit": {
            "serial_number": row.serial_number,
            "part_number": row.part_number,
            "position": None if is_removed else last.position,
            "hours": latest_hours(entries.flights, entries.removals, entries.findings),
            "cycles": max(
                (flight.cycles for flight in entries.flights if flight.cycles is not None), default=None
            ),
        },
        **entries.to_dict(),
        "diagnoses": [diagnosis_blocks(diagnosis) for diagnosis in diagnoses],
        "replacements": [
            {"hours": finding.hours, "component": finding.component}
            for finding in entries.findings
            if finding.replaced
        ],
        "notes": [*contradictions(diagnoses, entries.findings), *differences],
        "lives": {name: [life.to_dict() for life in entries.lives(name)] for name in FINDABLE},
        **(
            {"prognostic_assessment": None, "advisory_generation": None}
            if prognosis is None
            else prognosis_blocks(prognosis, out_of_date=not prognosis.is_current(basis))
        ),
    }


def prognosis_blocks(kept: KeptPrognosis, *, out_of_date: bool) -> dict[str, Any]:
    """Return a prognosis in the last two blocks; each key of `emaphm prognose --json` is in one block."""
    assessment = dict(kept.document)
    advice = assessment.pop("advice", None)
    return {
        "prognostic_assessment": assessment | {"made_at": kept.at, "out_of_date": out_of_date},
        "advisory_generation": advice,
    }


def _taken(document: dict[str, Any], names: tuple[str, ...]) -> dict[str, Any]:
    return {name: document[name] for name in names if name in document}
