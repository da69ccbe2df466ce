"""The verb `history add`: diagnoses the recordings of a flight and stores the results in the history."""

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
from emaphm.errors import EmaphmError

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
    """The flight during which recordings were made."""

    unit: Unit
    hours: Hours
    cycles: Annotated[
        int | None,
        Parameter(converter=whole_number, help="Number of cycles of the unit since it was new."),
    ] = None
    position: Annotated[
        str | None,
        Parameter(help="Position of the unit on the aircraft; default as at its last flight."),
    ] = None
    part: Annotated[
        str | None, Parameter(help="Part number of the unit; default the name of the actuator.")
    ] = None
    load: Annotated[
        float | None,
        Parameter(help="Mean absolute load since the previous flight [N·m; N if linear]."),
    ] = None
    temperature: Annotated[
        float | None, Parameter(help="Mean temperature of the unit since the previous flight [K].")
    ] = None

    def entry(self, actuator: "Actuator", *, late: bool) -> "Entry":
        """Return the entry for the history; `HistoryError` if it is invalid."""
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
    *further: Annotated[Path, Parameter(help="Further recordings of the same flight.")],
    flight: Flight,
    actuator: ActuatorFile = "thesis",
    db: Database = DB,
    estimator: Annotated[
        Path | None,
        Parameter(help="Estimator written by 'emaphm train', whose answer is the start of the search."),
    ] = None,
    fast: Fast = False,
    late: Annotated[
        bool,
        Parameter(
            negative="",
            help="Accept flight hours below the latest hours of the unit, for an old recording.",
        ),
    ] = False,
    seed: Seed = 0,
    as_json: AsJson = False,
) -> None:
    """Diagnose recordings of one flight and add them to the history; recordings stored before are skipped."""
    check_seed(seed)
    check_fast(fast, estimator)
    described = described_actuator(actuator)
    from emaphm.fleet import DiagnosisSettings
    from emaphm.history import History

    entry = flight.entry(described, late=late)
    recordings = [recording_of(path, described) for path in (recording, *further)]
    estimator_file = None if estimator is None else str(estimator)
    settings = DiagnosisSettings(seed=seed, estimator=estimator_file, fast=fast)
    settings.check_estimator()  # before a history is created
    with History.open(db, create=True) as history:
        known = [stored.serial_number for stored in history.units()]
        kept = _add_missing(history, entry, recordings, described, settings, quiet=as_json)
        notes = history.unit(flight.unit).description_notes()
    is_new = flight.unit not in known
    values = {
        "unit": flight.unit,
        "part_number": entry.part_number,
        "new_unit": is_new,
        "similar_units": [
            serial for serial in known if is_new and _normalised(serial) == _normalised(flight.unit)
        ],
        "hours": flight.hours,
        "cycles": kept[-1][1].flight.cycles,
        "db": history.database.address.shown,
        "recordings": [
            _recording_values(recorded.source, diagnosis, added=added)
            for recorded, (added, diagnosis) in zip(recordings, kept, strict=True)
        ],
        "notes": list(notes),
    }
    show(values, _text(values), as_json)


def _add_missing(
    history: "History",
    entry: "Entry",
    recordings: "Sequence[Recording]",
    actuator: "Actuator",
    settings: "DiagnosisSettings",
    *,
    quiet: bool,
) -> "list[tuple[bool, KeptDiagnosis]]":
    """Diagnose and add the recordings that the history lacks.

    Returns
    -------
    For each recording, whether it was added, and its stored diagnosis.
    """

    def is_missing(recording: "Recording") -> bool:
        return history.missing(entry, recording, actuator, settings.seed, settings.method_names)

    # Invalid recordings are refused before any is diagnosed.
    for recording in recordings:
        is_missing(recording)
    kept: list[tuple[bool, KeptDiagnosis]] = []
    for recording in recordings:
        # Checked again: the same recording may have been given twice.
        added = is_missing(recording)
        if added:
            try:
                with progress(f"diagnosing {recording.source}", quiet) as advance:
                    diagnosis = settings.diagnosed(recording, actuator, workers=None, on_progress=advance)
            except EmaphmError as error:
                raise type(error)(f"{error}{_progress_made(recordings, len(kept))}") from None
            added = history.add(entry, recording, diagnosis, actuator).added
        stored = history.kept(recording, actuator, settings.seed, settings.method_names)
        assert stored is not None  # noqa: S101 - it was stored before, or was added
        kept.append((added, stored))
    return kept


def _progress_made(recordings: "Sequence[Recording]", failed: int) -> str:
    """Return as text which recordings are in the history although that of index `failed` is not."""
    parts = [("in the history", recordings[:failed]), ("not diagnosed", recordings[failed + 1 :])]
    return "".join(f"; {what}: {', '.join(each.source for each in some)}" for what, some in parts if some)


def _recording_values(source: str, kept: "KeptDiagnosis", *, added: bool) -> dict[str, Any]:
    """Return the JSON values of a recording that was to be added, from its stored diagnosis."""
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
            *(f"{recorded['recording']}: {_outcome(recorded)}" for recorded in values["recordings"]),
            *(f"Note: {note}." for note in values["notes"]),
            f"{unit} ({values['part_number']}) at {values['hours']:.9g} h, in {values['db']}",
            *map(_similarity_note, values["similar_units"]),
        ]
    )


def _outcome(recorded: dict[str, Any]) -> str:
    if not recorded["added"]:
        return "is in the history already"
    if not recorded["explained"]:
        return "added, but no model explains it"
    degraded = f"degraded in {', '.join(recorded['degraded'])}"
    return f"diagnosed and added: {degraded if recorded['degraded'] else recorded['health']}"


def _normalised(serial_number: str) -> str:
    """Return the letters and digits of a serial number, without case: equal for two spellings of it."""
    return "".join(character for character in serial_number.casefold() if character.isalnum())


def _similarity_note(serial_number: str) -> str:
    return (
        f"Note: the history has a unit {serial_number} too; if it is the same unit, withdraw this recording "
        f"with 'emaphm history withdraw' and add it to {serial_number}."
    )
