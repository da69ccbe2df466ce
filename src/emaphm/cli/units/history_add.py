"""The verb `history add`: recordings of a flight are diagnosed and kept."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from emaphm.cli.options import (
    ActuatorFile,
    AsJson,
    Fast,
    RecordingFile,
    Seed,
    check_fast,
    check_seed,
    described_actuator,
    recording_of,
    whole_number,
)
from emaphm.cli.output import progress, show
from emaphm.cli.units.history_options import DB, Database, Hours, Unit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from emaphm.actuator import Actuator
    from emaphm.fleet import DiagnosisSettings
    from emaphm.history import Entry, History
    from emaphm.history.kept_diagnosis import KeptDiagnosis
    from emaphm.recording import Recording


@Parameter(name="*")
@dataclass(frozen=True)
class Flight:
    """The flight that recordings are of."""

    unit: Unit
    hours: Hours
    cycles: Annotated[
        int | None, Parameter(converter=whole_number, help="Cycles of the unit since it was new.")
    ] = None
    position: Annotated[
        str | None, Parameter(help="Place on the aircraft; as at the last flight if left out.")
    ] = None
    part: Annotated[
        str | None, Parameter(help="Part number of the unit; the actuator's name if left out.")
    ] = None
    load: Annotated[
        float | None,
        Parameter(help="Mean size of the load since the flight before [N·m, N of a linear actuator]."),
    ] = None
    temperature: Annotated[
        float | None, Parameter(help="Mean temperature of the unit since the flight before [K].")
    ] = None

    def entry(self, actuator: "Actuator", *, late: bool) -> "Entry":
        """Return what is added to the history; `HistoryError` where it cannot be."""
        from emaphm.history import Entry

        part = self.part or actuator.name
        return Entry(
            unit=self.unit,
            part_number=part,
            hours=self.hours,
            cycles=self.cycles,
            position=self.position,
            late=late,
            load=self.load,
            temperature=self.temperature,
        )


def add(
    recording: RecordingFile,
    *further: Annotated[Path, Parameter(help="More recordings of the same flight.")],
    flight: Flight,
    actuator: ActuatorFile = "thesis",
    db: Database = DB,
    estimator: Annotated[
        Path | None, Parameter(help="Begin where an estimator of 'emaphm train' says.")
    ] = None,
    fast: Fast = False,
    late: Annotated[
        bool, Parameter(negative="", help="These hours may be below the unit's latest: an old recording.")
    ] = False,
    seed: Seed = 0,
    as_json: AsJson = False,
) -> None:
    """Diagnose recordings of one flight and add them; what is in the history already is left as it is."""
    check_seed(seed)
    check_fast(fast, estimator)
    described = described_actuator(actuator)
    from emaphm.fleet import DiagnosisSettings
    from emaphm.history import History

    entry = flight.entry(described, late=late)
    recordings = [recording_of(path, described) for path in (recording, *further)]
    asked = None if estimator is None else str(estimator)
    settings = DiagnosisSettings(seed=seed, estimator=asked, fast=fast)
    settings.check_estimator()  # before a history is made
    with History.open(db, create=True) as history:
        known = [one.serial_number for one in history.units()]
        kept = _added(history, entry, recordings, described, settings, quiet=as_json)
        notes = history.unit(flight.unit).description_notes()
    is_new = flight.unit not in known
    values = {
        "unit": flight.unit,
        "part_number": entry.part_number,
        "new_unit": is_new,
        "similar_units": [one for one in known if is_new and _letters(one) == _letters(flight.unit)],
        "hours": flight.hours,
        "cycles": kept[-1][1].flight.cycles,
        "db": history.database.address.shown,
        "recordings": [
            _recording(one.source, found, added=added)
            for one, (added, found) in zip(recordings, kept, strict=True)
        ],
        "notes": list(notes),
    }
    show(values, _text(values), as_json)


def _added(
    history: "History",
    entry: "Entry",
    recordings: "Sequence[Recording]",
    actuator: "Actuator",
    settings: "DiagnosisSettings",
    *,
    quiet: bool,
) -> "list[tuple[bool, KeptDiagnosis]]":
    """Diagnose and add what the history lacks; return of each recording whether it did, and what it holds."""

    def is_missing(recording: "Recording") -> bool:
        return history.missing(entry, recording, actuator, settings.seed, settings.method_names)

    # What cannot be added is refused before anything is diagnosed.
    for one in recordings:
        is_missing(one)
    kept = []
    for one in recordings:
        # Asked anew: the same recording may have been given twice.
        added = is_missing(one)
        if added:
            with progress(f"diagnosing {one.source}", quiet) as advance:
                diagnosis = settings.diagnosed(one, actuator, workers=None, on_progress=advance)
            added = history.add(entry, one, diagnosis, actuator).added
        found = history.kept(one, actuator, settings.seed, settings.method_names)
        assert found is not None  # noqa: S101 - it was there, or was added
        kept.append((added, found))
    return kept


def _recording(source: str, kept: "KeptDiagnosis", *, added: bool) -> dict[str, Any]:
    """Return what the history holds of a recording that was to be added."""
    from emaphm.actuator.faults import degraded_in, health_in

    return {
        "recording": source,
        "recording_hash": kept.recording_hash,
        "added": added,
        "explained": kept.explained,
        "k": kept.vector.tolist(),
        "health": health_in(kept.document),
        "degraded": list(degraded_in(kept.document)),
    }


def _text(values: dict[str, Any]) -> str:
    unit = f"{'new unit' if values['new_unit'] else 'unit'} {values['unit']}"
    return "\n".join(
        [
            *(f"{one['recording']}: {_outcome(one)}" for one in values["recordings"]),
            *(f"note: {one}" for one in values["notes"]),
            f"{unit} ({values['part_number']}) at {values['hours']:.9g} h, in {values['db']}",
            *map(_similar, values["similar_units"]),
        ]
    )


def _outcome(one: dict[str, Any]) -> str:
    if not one["added"]:
        return "is in the history already"
    if not one["explained"]:
        return "added, but no model explains it"
    degraded = f"degraded in {', '.join(one['degraded'])}"
    return f"diagnosed and added: {degraded if one['degraded'] else one['health']}"


def _letters(serial_number: str) -> str:
    """Return what two spellings of one serial number share: its letters and digits, without their case."""
    return "".join(one for one in serial_number.casefold() if one.isalnum())


def _similar(serial_number: str) -> str:
    return (
        f"Note: the history has a unit {serial_number} too; if it is the same, withdraw this recording by "
        "'emaphm history withdraw' and add it there."
    )
