"""A unit's history as JSON, its parts named after the blocks of ISO 13374-1 (data processing).

Data acquisition is the rig's; the blocks from there on are data manipulation, state detection, health
assessment, prognostic assessment and advisory generation. The last two are those of the unit's last kept
prognosis (`emaphm prognose --keep`, `emaphm watch`), null where it has none.
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
"""What was done to the recording's channels before they were compared."""

STATE_DETECTION = ("explained", "reasons", "moves", "residual_rms_A", "laws", "sensor_faults", "detector")
"""Whether the recording is what the described actuator does."""

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
"""How it was computed."""


def diagnosis_blocks(diagnosis: KeptDiagnosis) -> dict[str, Any]:
    """Return a diagnosis in blocks: each key of `emaphm diagnose --json` is in one of them, once."""
    document = diagnosis.document
    manipulated = {"recording_hash": diagnosis.recording_hash, **_taken(document, DATA_MANIPULATION)}
    manipulated["recording"] = diagnosis.recording
    return {
        "hours": diagnosis.flight.hours,
        "cycles": diagnosis.flight.cycles,
        "position": diagnosis.flight.position,
        "added_at": diagnosis.added_at,
        "data_manipulation": manipulated,
        "state_detection": _taken(document, STATE_DETECTION),
        # All else is on the faults, also what a later version adds.
        "health_assessment": {
            key: value
            for key, value in document.items()
            if key not in (*DATA_MANIPULATION, *STATE_DETECTION, *METHOD)
        },
        "settings": {"description": diagnosis.settings.description, **_taken(document, METHOD)},
    }


def unit_blocks(unit: Unit) -> dict[str, Any]:
    """Return all that a history holds of a unit."""
    with unit.database.reading() as connection:  # one state of all
        entries = UnitEntries.read(connection, unit.row.id, unit.serial_number)
        diagnoses = reading.diagnoses(connection, unit.row.id)
        kept = read_prognosis(connection, unit.row.id)
        basis = bases(connection, UNITS.c.id == unit.row.id)[unit.row.id]
        described = description_notes(connection, unit.row)
    last = entries.flights[-1]
    is_removed = any(one.hours >= last.hours for one in entries.removals)
    return {
        "unit": {
            "serial_number": unit.serial_number,
            "part_number": unit.part_number,
            "position": None if is_removed else last.position,
            "hours": latest_hours(entries.flights, entries.removals, entries.findings),
            "cycles": max((one.cycles for one in entries.flights if one.cycles is not None), default=None),
        },
        **entries.to_dict(),
        "diagnoses": [diagnosis_blocks(one) for one in diagnoses],
        "replacements": [
            {"hours": one.hours, "component": one.component} for one in entries.findings if one.replaced
        ],
        "notes": [*contradictions(diagnoses, entries.findings), *described],
        "lives": {name: [one.to_dict() for one in entries.lives(name)] for name in FINDABLE},
        **(
            {"prognostic_assessment": None, "advisory_generation": None}
            if kept is None
            else prognosis_blocks(kept, out_of_date=not kept.is_current(basis))
        ),
    }


def prognosis_blocks(kept: KeptPrognosis, *, out_of_date: bool) -> dict[str, Any]:
    """Return a prognosis in the last two blocks: each key of `emaphm prognose --json` is in one of them."""
    assessed = dict(kept.document)
    advised = assessed.pop("advice", None)
    return {
        "prognostic_assessment": assessed | {"made_at": kept.at, "out_of_date": out_of_date},
        "advisory_generation": advised,
    }


def _taken(document: dict[str, Any], names: tuple[str, ...]) -> dict[str, Any]:
    return {name: document[name] for name in names if name in document}
