"""The worker process, which diagnoses uploads and computes prognoses, one at a time."""

import logging
import os
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from emaphm.errors import EmaphmError, HistoryError, HistoryUnavailableError, OutputError
from emaphm.execution.one_process import prepare_worker
from emaphm.monitoring.settings import WATCH, PrognosisSettings
from emaphm.server.folders import ServerFolder
from emaphm.server.work.queue import AGAIN, DONE, FAILED, REFUSED
from emaphm.server.work.statement import AS_BEFORE, entry_of, in_fields, known_unit

if TYPE_CHECKING:
    from emaphm.actuator import Actuator
    from emaphm.detection import Detector
    from emaphm.diagnosis import Diagnosis
    from emaphm.history import History, Unit
    from emaphm.history.kept_diagnosis import KeptDiagnosis
    from emaphm.history.reading import UnitRow
    from emaphm.progress import Progress
    from emaphm.recording import Recording

LOG = logging.getLogger("emaphm.server")

SERVER = "server"
"""Name of the watcher in the events from diagnoses and prognoses of the server."""

NICENESS = 3
"""Priority of a worker, below that of the pages, because it uses a core for seconds. If all cores are busy,
it has half the share of other processes; with 10 it would have a tenth, and uploads would wait for
minutes."""


@dataclass(frozen=True)
class Upload:
    """A job: the file of a recording, and the fields of the upload."""

    file: Path
    name: str
    request: dict[str, Any] = field(repr=False)


@dataclass(frozen=True)
class Forecast:
    """A job: the prognosis of the unit with this serial number."""

    unit: str


@dataclass(frozen=True)
class JobOutcome:
    """Final state of a job, with a message and the result."""

    state: str
    message: str = ""
    result: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Place:
    """Paths and settings of a worker: the history's address, the server's folder, descriptions by name.

    `detector` compares an upload with healthy recordings. `prognosis` contains the thresholds from which a
    remaining useful life raises an event. `seed` is the source of randomness of diagnoses and prognoses.
    """

    db: str
    folder: ServerFolder
    actuators: "dict[str, Actuator]" = field(repr=False)
    memory_bytes: int
    upload_bytes: int
    detector: "Detector | None" = field(default=None, repr=False)
    prognosis: PrognosisSettings = WATCH.prognosis
    seed: int = 0


def work(orders: Connection, parent: Connection, place: Place) -> None:
    """Execute the jobs received from `orders` until the server ends; send progress and a `JobOutcome`."""
    prepare_worker(parent, place.memory_bytes)
    os.nice(NICENESS)
    with suppress(EOFError, OSError):  # the server has ended
        while True:
            job = orders.recv()
            orders.send(_outcome(job, place, orders))


def _outcome(job: Upload | Forecast, place: Place, orders: Connection) -> JobOutcome:
    """Return the outcome of a job, "failed" after an unexpected error, whose traceback is logged."""
    try:
        return _executed(job, place, orders)
    except ConnectionError:  # the server has ended
        raise
    except Exception as error:
        LOG.exception("a defect of emaphm; the worker goes on")
        return JobOutcome(FAILED, unexpected(error))


def unexpected(error: Exception) -> str:
    """Return the message for an unexpected error; clients must not learn its text, which may name paths."""
    return f"an unexpected error ({type(error).__name__}); the log of the server contains its cause"


def _executed(job: Upload | Forecast, place: Place, orders: Connection) -> JobOutcome:
    from emaphm.history import History
    from emaphm.monitoring.outlook import prognosed

    try:
        with History.open(place.db) as history:
            if isinstance(job, Forecast):
                prognosed(history, job.unit, place.prognosis, place.seed, SERVER)
                return JobOutcome(DONE)
            return _diagnosed(job, history, place, orders)
    except HistoryUnavailableError as error:  # not an error of the recording
        return JobOutcome(AGAIN, str(error))
    except EmaphmError as error:
        text = str(error)
        if isinstance(job, Upload):
            text = text.replace(str(job.file), job.name)  # clients must not learn the path on the server
            text = in_fields(text)
        return JobOutcome(REFUSED, text)
    except MemoryError:
        return JobOutcome(
            FAILED, "it takes more memory than a worker may have; cut one manoeuvre out of the recording"
        )


def _diagnosed(job: Upload, history: "History", place: Place, orders: Connection) -> JobOutcome:
    from emaphm.actuator.faults import degraded_in, health_in
    from emaphm.monitoring.judging import Judge
    from emaphm.recording import read_recording
    from emaphm.recording.io.limits import ReadLimits

    known = known_unit(history, job.request)
    actuator = _described(known, job.request, place)
    entry = entry_of(job.request, actuator.name if known is None else known.part_number)
    recording = read_recording(job.file, actuator, limits=ReadLimits(file_bytes=place.upload_bytes))
    recording = replace(recording, source=job.name)
    judge = Judge(
        history,
        actuator,
        WATCH.alarm,
        partial(_searched, on_progress=orders.send),
        None,
        place.detector,
        takes_new_units=True,
        seed=place.seed,
        watcher=SERVER,
    )
    diagnosis = judge.judged(entry, recording)
    events = judge.filed(entry, recording, diagnosis, {})
    number, unit, kept = _filed(history, recording)
    result = {
        "diagnosis": number,
        "unit_id": unit.id,
        "recording_hash": kept.recording_hash,
        "explained": kept.explained,
        "health": health_in(kept.document),
        "degraded": list(degraded_in(kept.document)),
        "events": [event.message for event in events],
    }
    if diagnosis is None:
        return JobOutcome(DONE, "is in the history already", result)
    try:
        _write_report(diagnosis, kept, place.folder)
    except (OutputError, MemoryError) as error:  # the diagnosis itself is already in the history
        LOG.warning("no report of diagnosis %d: %s", number, error or "it takes too much memory")
        return JobOutcome(DONE, "is in the history, but its report could not be kept", result)
    return JobOutcome(DONE, "", result)


def _searched(
    recording: "Recording", actuator: "Actuator", *, seed: int, on_progress: "Progress"
) -> "Diagnosis":
    from emaphm.diagnosis import diagnose

    return diagnose(recording, actuator, seed=seed, workers=1, on_progress=on_progress)


def _described(known: "Unit | None", request: dict[str, Any], place: Place) -> "Actuator":
    """Return the description for a diagnosis: one of the server, or that of the unit's last diagnosis."""
    if known is None or request["actuator"] != AS_BEFORE:
        return place.actuators[request["actuator"]]
    return known.actuator


def _filed(history: "History", recording: "Recording") -> "tuple[int, UnitRow, KeptDiagnosis]":
    """Return the number, the unit and the stored form of the last diagnosis of a recording."""
    from emaphm.history.views import diagnosis, last_diagnosis
    from emaphm.recording.content import recording_hash

    key = recording_hash(recording)
    with history.database.reading() as connection:
        number = last_diagnosis(connection, key)
        stored = None if number is None else diagnosis(connection, number)
    if number is None or stored is None:
        raise HistoryError("the diagnosis is not in the history; upload the recording again")
    unit, kept, _ = stored
    return number, unit, kept


def _write_report(diagnosis: "Diagnosis", kept: "KeptDiagnosis", folder: ServerFolder) -> None:
    """Write the report and the figures of the recording, which are not stored in the history."""
    from emaphm.output_files import written_whole
    from emaphm.plotting.diagnosis import draw_fit, draw_residual
    from emaphm.plotting.svg import plain_style, svg
    from emaphm.report import write_report

    with plain_style():
        figures = {"fit": svg(draw_fit(diagnosis)), "residual": svg(draw_residual(diagnosis))}
    for name, content in figures.items():
        with written_whole(folder.figure(kept, name)) as temporary:
            temporary.write_bytes(content)
    write_report(diagnosis, folder.report(kept), force=True)
