"""The HTTP API under /api/v1: what the pages show, as JSON."""

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
"""Of a row in a database."""

router = APIRouter(prefix="/api/v1")


def state_of(request: Request) -> ServerState:
    """Return what the server shares."""
    found: ServerState = request.app.state.server
    return found


Server = Annotated[ServerState, Depends(state_of)]
Id = Annotated[int, Path(ge=1, le=LARGEST_ID)]
Limit = Annotated[int, Query(ge=1, le=1000, description="How many at most.")]
Before = Annotated[
    int | None, Query(ge=1, le=LARGEST_ID, description="Only those of lower numbers: the next page.")
]
Sort = Annotated[str, Query(description="By what they are sorted."), OneOf(tuple(SORTS))]
Advice = Annotated[str, Query(description="Only this advice."), OneOf((*ACTIONS, "none"))]
Health = Annotated[str, Query(description="Only where the last diagnosis says so."), OneOf(HEALTHS)]
Kind = Annotated[str, Query(description="Only of this kind."), OneOf(KINDS)]
UnitId = Annotated[int | None, Query(ge=1, le=LARGEST_ID, description="Only of the unit of this id.")]


class Units(BaseModel):
    """Units, and how many the history has."""

    units: list[FleetRow]
    shown: int = Field(description="How many units the filters leave.")
    total: int


class Diagnoses(BaseModel):
    """Diagnoses with their recordings, the newest first."""

    diagnoses: list[DiagnosisLine]
    total: int = Field(description="How many the unit and explained leave, on all pages.")


class DataHealth(BaseModel):
    """What cannot be trusted: units whose last recording is not explained or shows a fault of a sensor."""

    not_explained: list[FleetRow]
    sensor_faults: list[FleetRow]
    recordings: list[DiagnosisLine] = Field(
        description="Recordings that are not explained, the newest first."
    )
    total: int = Field(description="How many recordings are not explained, on all pages.")


class Events(BaseModel):
    """Events, the newest or the oldest first."""

    events: list[dict[str, Any]]
    total: int = Field(description="How many the unit, the kind and only_open leave, on all pages.")


class JobAnswer(BaseModel):
    """An upload, and what has become of it."""

    id: int
    state: str = Field(description="waiting, running, done, refused or failed.")
    progress: float = Field(description="How much is done, 0 to 1.")
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
    total: int = Field(description="How many there are, on all pages.")


class Refusal(BaseModel):
    """Why a request was refused."""

    detail: Any


NOT_FOUND: dict[int | str, dict[str, Any]] = {404: {"model": Refusal}}


@router.get("/units")
def units(
    server: Server,
    sort: Sort = "urgency",
    descending: Annotated[bool, Query(description="The other way round.")] = False,
    part: Annotated[str, Query(description="Only this part number.")] = "",
    advice: Advice = "",
    health: Health = "",
    search: Annotated[str, Query(description="Part of a serial number or a position.")] = "",
    limit: Limit = 1000,
    offset: Annotated[int, Query(ge=0, le=LARGEST_ID)] = 0,
) -> Units:
    """Return the units of the fleet, the most urgent first."""
    fleet = server.fleet.fleet()
    check_value("part", part, fleet.part_numbers)
    rows = Choice(sort or "urgency", descending, part, advice, health, search).of(fleet.rows)
    return Units(units=rows[offset : offset + limit], shown=len(rows), total=len(fleet.rows))


@router.get("/units/{unit_id}", responses=NOT_FOUND)
def unit(server: Server, unit_id: Id) -> dict[str, Any]:
    """Return a unit: its state, flights, removals, findings, withdrawals, and its lives as a whole."""
    row = row_of(server, unit_id)
    with server.history.database.reading() as connection:  # one state of all
        entries = UnitEntries.read(connection, row.id, row.unit)
    lives = [one.to_dict() for one in entries.lives()]
    return _finite({"unit": asdict(row), **entries.to_dict(), "lives": lives})


@router.get("/units/{unit_id}/prognosis", responses=NOT_FOUND)
def prognosis(server: Server, unit_id: Id) -> dict[str, Any]:
    """Return the prognosis of a unit, as `emaphm prognose --json` prints it."""
    kept = prognosis_of(server, row_of(server, unit_id))
    if kept is None:
        raise HTTPException(404, "no prognosis of this unit has been made yet")
    return _kept(kept)


@router.get("/units/{unit_id}/curves", responses=NOT_FOUND)
def curves(server: Server, unit_id: Id) -> dict[str, Any]:
    """Return what the figures of a unit's prognosis show."""
    row_of(server, unit_id)
    with server.history.database.reading() as connection:
        found = read_curves(connection, unit_id)
    if found is None:
        raise HTTPException(404, "no prognosis of this unit has been kept with its curves yet")
    return found


@router.get("/prognoses")
def prognoses(server: Server) -> dict[str, dict[str, Any]]:
    """Return the last prognosis of each unit by its serial number, of those that have one."""
    return {unit: _kept(one) for unit, one in server.history.prognoses().items()}


@router.get("/recordings", name="recordings", responses=NOT_FOUND)
@router.get("/diagnoses", responses=NOT_FOUND)
def diagnoses(
    server: Server,
    unit_id: UnitId = None,
    explained: Annotated[bool | None, Query(description="Only those that are, or are not.")] = None,
    before: Before = None,
    limit: Limit = 100,
) -> Diagnoses:
    """Return the last diagnosis of each recording in short, the newest first."""
    if unit_id is not None:
        row_of(server, unit_id)
    with server.history.database.reading() as connection:
        found = diagnosis_lines(connection, unit_id=unit_id, explained=explained, before=before, limit=limit)
    return Diagnoses(
        diagnoses=list(found), total=server.fleet.fleet().recordings(unit_id, explained=explained)
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
        int | None, Query(ge=0, le=LARGEST_ID, description="Only those of higher numbers.")
    ] = None,
    before: Before = None,
    newest_first: bool = True,
    only_open: Annotated[bool, Query(description="Only what was raised and not cleared since.")] = False,
    limit: Limit = 100,
) -> Events:
    """Return events."""
    serial = None if unit_id is None else row_of(server, unit_id).unit
    if only_open:
        still_open = [one for one in server.history.open_conditions(serial) if kind in ("", one.kind)]
        lowest, end = after or 0, before or LARGEST_ID
        found = [one for one in still_open if lowest < (one.number or 0) < end]
        found = (found[::-1] if newest_first else found)[:limit]
        return Events(events=[one.to_dict() for one in found], total=len(still_open))
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
    return Events(events=[one.to_dict() for one in page], total=total)


@router.get("/data-health")
def data_health(server: Server, before: Before = None, limit: Limit = 100) -> DataHealth:
    """Return what cannot be trusted; `before` and `limit` are of the recordings."""
    return untrusted(server, before=before, limit=limit)


def untrusted(server: ServerState, *, before: int | None = None, offset: int = 0, limit: int) -> DataHealth:
    """Return what cannot be trusted, with the recordings that the others choose of those not explained."""
    fleet = server.fleet.fleet()
    rows = Choice(sort="unit").of(fleet.rows)
    with server.history.database.reading() as connection:
        found = diagnosis_lines(connection, explained=False, before=before, offset=offset, limit=limit)
    return DataHealth(
        not_explained=[row for row in rows if row.health == "not explained"],
        sensor_faults=[row for row in rows if row.sensor_faults],
        recordings=list(found),
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
    """Take a recording to be diagnosed; the job says what becomes of it."""
    from starlette.concurrency import run_in_threadpool

    async with server.uploads.form(request) as form:
        number = await run_in_threadpool(server.uploads.received, form)
    return await run_in_threadpool(job, server, number)


@router.get("/jobs")
def jobs(server: Server, before: Before = None, limit: Limit = 100) -> Jobs:
    """Return uploads and what has become of them, the newest first."""
    found = server.queue.jobs(limit, before)
    return Jobs(jobs=[job_answer(server, one) for one in found], total=server.queue.total())


@router.get("/jobs/{job_id}", responses=NOT_FOUND)
def job(server: Server, job_id: Id) -> JobAnswer:
    """Return an upload and what has become of it."""
    found = server.queue.job(job_id)
    if found is None:
        raise HTTPException(404, f"no upload {job_id}")
    return job_answer(server, found)


def job_answer(server: ServerState, found: Job) -> JobAnswer:
    """Return a job as the API gives it."""
    return JobAnswer(
        id=found.id,
        state=found.state,
        progress=1.0 if found.is_over else server.pool.progress(found.id),
        recording=found.request["name"],
        unit=found.request["unit"],
        hours=found.request["hours"],
        message=found.message,
        result=found.result,
        added_at=found.added_at,
        ended_at=found.ended_at,
    )


def row_of(server: ServerState, unit_id: int) -> FleetRow:
    """Return a unit's row; 404 where there is none."""
    found = server.fleet.row(unit_id)
    if found is None:
        raise HTTPException(404, f"no unit {unit_id} in the history")
    return found


def diagnosis_of(server: ServerState, diagnosis_id: int) -> tuple[UnitRow, KeptDiagnosis, str]:
    """Return a diagnosis with its unit and the TOML of its description; 404 where there is none."""
    with server.history.database.reading() as connection:
        found = diagnosis(connection, diagnosis_id)
    if found is None:
        raise HTTPException(404, f"no diagnosis {diagnosis_id} in the history")
    return found


def prognosis_of(server: ServerState, row: FleetRow) -> KeptPrognosis | None:
    """Return the kept prognosis of a unit."""
    return server.fleet.prognosis(row.unit)


def _finite(values: dict[str, Any]) -> dict[str, Any]:
    return dict(finite(values))


def _kept(one: KeptPrognosis) -> dict[str, Any]:
    return {**one.document, "made_at": one.at}
