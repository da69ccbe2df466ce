"""The HTTP API under /api/v1: the contents of the pages as JSON."""

from dataclasses import asdict
from typing import Annotated, Any

from fastapi import APIRouter, Depends, HTTPException, Path, Query, Request
from pydantic import BaseModel, Field

from emaphm.actuator.faults import HEALTHS
from emaphm.history.blocks import diagnosis_blocks
from emaphm.history.entries import UnitEntries
from emaphm.history.events import KINDS, count_events, read_events
from emaphm.history.kept_diagnosis import KeptDiagnosis
from emaphm.history.kept_prognosis import KeptPrognosis
from emaphm.history.reading import UnitRow
from emaphm.history.views import DiagnosisLine, diagnosis, diagnosis_lines, read_curves
from emaphm.server.fleet import ACTIONS, SORTS, Choice, FleetRow
from emaphm.server.query import OneOf, check_value
from emaphm.server.state import ServerState
from emaphm.server.work.queue import Job
from emaphm.strict_json import finite

LARGEST_ID = 2**31 - 1
"""Largest id of a row in a database."""

router = APIRouter(prefix="/api/v1")


def state_of(request: Request) -> ServerState:
    """Return the state that all requests share."""
    state: ServerState = request.app.state.server
    return state


Server = Annotated[ServerState, Depends(state_of)]
Id = Annotated[int, Path(ge=1, le=LARGEST_ID)]
Limit = Annotated[int, Query(ge=1, le=1000, description="Largest number of entries in the answer.")]
Before = Annotated[
    int | None, Query(ge=1, le=LARGEST_ID, description="Only entries with lower numbers: the next page.")
]
Sort = Annotated[str, Query(description="Quantity by which units are sorted."), OneOf(tuple(SORTS))]
Advice = Annotated[str, Query(description="Only units with this advice."), OneOf((*ACTIONS, "none"))]
Health = Annotated[
    str, Query(description="Only units with this health in the last diagnosis."), OneOf(HEALTHS)
]
Kind = Annotated[str, Query(description="Only events of this kind."), OneOf(KINDS)]
UnitId = Annotated[int | None, Query(ge=1, le=LARGEST_ID, description="Only the unit with this id.")]


class Units(BaseModel):
    """Units, their number after the filters, and the number in the history."""

    units: list[FleetRow]
    shown: int = Field(description="Number of units after the filters.")
    total: int


class Diagnoses(BaseModel):
    """Diagnoses with their recordings, the newest first."""

    diagnoses: list[DiagnosisLine]
    total: int = Field(description="Number of diagnoses with this unit and explained, on all pages.")


class DataHealth(BaseModel):
    """Units whose last recording is not explained or has a sensor fault, and recordings not explained."""

    not_explained: list[FleetRow]
    sensor_faults: list[FleetRow]
    recordings: list[DiagnosisLine] = Field(
        description="Recordings that are not explained, the newest first."
    )
    total: int = Field(description="Number of recordings that are not explained, on all pages.")


class Events(BaseModel):
    """Events, the newest or the oldest first."""

    events: list[dict[str, Any]]
    total: int = Field(description="Number of events with this unit, kind and only_open, on all pages.")


class JobAnswer(BaseModel):
    """An upload, its state and its result."""

    id: int
    state: str = Field(description="waiting, running, done, refused or failed.")
    progress: float = Field(description="Share that is done, 0 to 1.")
    recording: str
    unit: str
    hours: float
    message: str
    result: dict[str, Any]
    added_at: str
    ended_at: str | None


class Jobs(BaseModel):
    """Uploads, the newest first."""

    jobs: list[JobAnswer]
    total: int = Field(description="Number of uploads, on all pages.")


class Refusal(BaseModel):
    """Reason why a request was refused."""

    detail: Any


NOT_FOUND: dict[int | str, dict[str, Any]] = {404: {"model": Refusal}}


@router.get("/units")
def units(
    server: Server,
    sort: Sort = "urgency",
    descending: Annotated[bool, Query(description="Whether the order is reversed.")] = False,
    part: Annotated[str, Query(description="Only units with this part number.")] = "",
    advice: Advice = "",
    health: Health = "",
    search: Annotated[str, Query(description="Part of a serial number or a position.")] = "",
    limit: Limit = 1000,
    offset: Annotated[int, Query(ge=0, le=LARGEST_ID)] = 0,
) -> Units:
    """Return the units of the fleet, by default the most urgent first."""
    fleet = server.fleet.fleet()
    check_value("part", part, fleet.part_numbers)
    rows = Choice(sort or "urgency", descending, part, advice, health, search).of(fleet.rows)
    return Units(units=rows[offset : offset + limit], shown=len(rows), total=len(fleet.rows))


@router.get("/units/{unit_id}", responses=NOT_FOUND)
def unit(server: Server, unit_id: Id) -> dict[str, Any]:
    """Return a unit: its state, flights, removals, findings, withdrawals, and complete lives."""
    row = row_of(server, unit_id)
    with server.history.database.reading() as connection:  # a consistent state of all tables
        entries = UnitEntries.read(connection, row.id, row.unit)
    lives = [life.to_dict() for life in entries.lives()]
    return _finite({"unit": asdict(row), **entries.to_dict(), "lives": lives})


@router.get("/units/{unit_id}/prognosis", responses=NOT_FOUND)
def prognosis(server: Server, unit_id: Id) -> dict[str, Any]:
    """Return the prognosis of a unit, as `emaphm prognose --json` prints it."""
    kept = prognosis_of(server, row_of(server, unit_id))
    if kept is None:
        raise HTTPException(404, "no prognosis of this unit has been made yet")
    return _with_time(kept)


@router.get("/units/{unit_id}/curves", responses=NOT_FOUND)
def curves(server: Server, unit_id: Id) -> dict[str, Any]:
    """Return the curves of the figures of a unit's prognosis."""
    row_of(server, unit_id)
    with server.history.database.reading() as connection:
        curves = read_curves(connection, unit_id)
    if curves is None:
        raise HTTPException(404, "no prognosis of this unit has been kept with its curves yet")
    return curves


@router.get("/prognoses")
def prognoses(server: Server) -> dict[str, dict[str, Any]]:
    """Return the last prognosis of each unit that has one, by serial number."""
    return {unit: _with_time(prognosis) for unit, prognosis in server.history.prognoses().items()}


@router.get("/recordings", name="recordings", responses=NOT_FOUND)
@router.get("/diagnoses", responses=NOT_FOUND)
def diagnoses(
    server: Server,
    unit_id: UnitId = None,
    explained: Annotated[
        bool | None, Query(description="Only explained recordings, or only the others.")
    ] = None,
    before: Before = None,
    limit: Limit = 100,
) -> Diagnoses:
    """Return a summary of the last diagnosis of each recording, the newest first."""
    if unit_id is not None:
        row_of(server, unit_id)
    with server.history.database.reading() as connection:
        lines = diagnosis_lines(connection, unit_id=unit_id, explained=explained, before=before, limit=limit)
    return Diagnoses(
        diagnoses=list(lines), total=server.fleet.fleet().recordings(unit_id, explained=explained)
    )


@router.get("/diagnoses/{diagnosis_id}", responses=NOT_FOUND)
def one_diagnosis(server: Server, diagnosis_id: Id) -> dict[str, Any]:
    """Return a diagnosis in the blocks of ISO 13374."""
    row, kept, _ = diagnosis_of(server, diagnosis_id)
    return _finite(
        {
            "id": diagnosis_id,
            "unit_id": row.id,
            "unit": row.serial_number,
            "part_number": row.part_number,
            **diagnosis_blocks(kept),
        }
    )


@router.get("/events", responses=NOT_FOUND)
def events(
    server: Server,
    unit_id: UnitId = None,
    kind: Kind = "",
    after: Annotated[
        int | None, Query(ge=0, le=LARGEST_ID, description="Only events with higher numbers.")
    ] = None,
    before: Before = None,
    newest_first: bool = True,
    only_open: Annotated[
        bool, Query(description="Only conditions that were raised and not cleared since.")
    ] = False,
    limit: Limit = 100,
) -> Events:
    """Return events, by default the newest first."""
    serial = None if unit_id is None else row_of(server, unit_id).unit
    if only_open:
        still_open = [event for event in server.history.open_conditions(serial) if kind in ("", event.kind)]
        lowest, end = after or 0, before or LARGEST_ID
        selected = [event for event in still_open if lowest < (event.number or 0) < end]
        selected = (selected[::-1] if newest_first else selected)[:limit]
        return Events(events=[event.to_dict() for event in selected], total=len(still_open))
    kinds = (kind,) if kind else ()
    with server.history.database.reading() as connection:
        page = read_events(
            connection,
            unit=serial,
            kinds=kinds,
            after=after,
            before=before,
            newest_first=newest_first,
            limit=limit,
        )
        total = count_events(connection, unit=serial, kinds=kinds)
    return Events(events=[event.to_dict() for event in page], total=total)


@router.get("/data-health")
def data_health(server: Server, before: Before = None, limit: Limit = 100) -> DataHealth:
    """Return units and recordings with unreliable data; `before` and `limit` select recordings."""
    return untrusted(server, before=before, limit=limit)


def untrusted(server: ServerState, *, before: int | None = None, offset: int = 0, limit: int) -> DataHealth:
    """Return units and recordings with unreliable data; the keywords select recordings not explained."""
    fleet = server.fleet.fleet()
    rows = Choice(sort="unit").of(fleet.rows)
    with server.history.database.reading() as connection:
        lines = diagnosis_lines(connection, explained=False, before=before, offset=offset, limit=limit)
    return DataHealth(
        not_explained=[row for row in rows if row.health == "not explained"],
        sensor_faults=[row for row in rows if row.sensor_faults],
        recordings=list(lines),
        total=fleet.recordings(explained=False),
    )


FIELDS = {
    "recording": {"type": "string", "format": "binary", "description": "The file."},
    "unit": {"type": "string", "description": "Serial number."},
    "hours": {"type": "number", "minimum": 0, "description": "Flight hours of the unit since it was new."},
    "cycles": {"type": "integer", "minimum": 0, "description": "Cycles of the unit since it was new."},
    "position": {"type": "string", "description": "Place on the aircraft; as before if left out."},
    "part": {"type": "string", "description": "Part number; as before, or the description's name."},
    "actuator": {"type": "string", "description": "Description; that of the unit's last diagnosis if empty."},
    "late": {"type": "boolean", "description": "An old recording: hours may be below the unit's latest."},
}
BODY = {
    "requestBody": {
        "required": True,
        "content": {
            "multipart/form-data": {
                "schema": {
                    "type": "object",
                    "properties": FIELDS,
                    "required": ["recording", "unit", "hours"],
                    "additionalProperties": False,
                }
            }
        },
    }
}


@router.post(
    "/recordings",
    status_code=202,
    openapi_extra=BODY,
    responses={code: {"model": Refusal} for code in (400, 408, 413, 422, 503)},
)
async def upload(request: Request, server: Server) -> JobAnswer:
    """Accept a recording for diagnosis; the job gives its state and result."""
    from starlette.concurrency import run_in_threadpool

    async with server.uploads.form(request) as form:
        number = await run_in_threadpool(server.uploads.received, form)
    return await run_in_threadpool(job, server, number)


@router.get("/jobs")
def jobs(server: Server, before: Before = None, limit: Limit = 100) -> Jobs:
    """Return uploads with their states and results, the newest first."""
    page = server.queue.jobs(limit, before)
    return Jobs(jobs=[job_answer(server, entry) for entry in page], total=server.queue.total())


@router.get("/jobs/{job_id}", responses=NOT_FOUND)
def job(server: Server, job_id: Id) -> JobAnswer:
    """Return an upload with its state and result."""
    queued = server.queue.job(job_id)
    if queued is None:
        raise HTTPException(404, f"no upload {job_id}")
    return job_answer(server, queued)


def job_answer(server: ServerState, queued: Job) -> JobAnswer:
    """Return the answer of the API for a job in the queue."""
    return JobAnswer(
        id=queued.id,
        state=queued.state,
        progress=1.0 if queued.is_over else server.pool.progress(queued.id),
        recording=queued.request["name"],
        unit=queued.request["unit"],
        hours=queued.request["hours"],
        message=queued.message,
        result=queued.result,
        added_at=queued.added_at,
        ended_at=queued.ended_at,
    )


def row_of(server: ServerState, unit_id: int) -> FleetRow:
    """Return the row of a unit; 404 if there is no such unit."""
    row = server.fleet.row(unit_id)
    if row is None:
        raise HTTPException(404, f"no unit {unit_id} in the history")
    return row


def diagnosis_of(server: ServerState, diagnosis_id: int) -> tuple[UnitRow, KeptDiagnosis, str]:
    """Return a diagnosis with its unit and the TOML of its description; 404 if there is no such diagnosis."""
    with server.history.database.reading() as connection:
        stored = diagnosis(connection, diagnosis_id)
    if stored is None:
        raise HTTPException(404, f"no diagnosis {diagnosis_id} in the history")
    return stored


def prognosis_of(server: ServerState, row: FleetRow) -> KeptPrognosis | None:
    """Return the stored prognosis of a unit, None if there is none."""
    return server.fleet.prognosis(row.unit)


def _finite(values: dict[str, Any]) -> dict[str, Any]:
    return dict(finite(values))


def _with_time(prognosis: KeptPrognosis) -> dict[str, Any]:
    return {**prognosis.document, "made_at": prognosis.at}
