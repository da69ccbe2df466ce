"""The web pages: HTML that works without JavaScript, with figures as SVG."""

import hashlib
import json
from importlib.util import find_spec
from pathlib import Path as FilePath
from typing import Annotated, Any
from urllib.parse import urlencode

from fastapi import APIRouter, Form, HTTPException, Query, Request
from starlette.concurrency import run_in_threadpool
from starlette.responses import FileResponse, HTMLResponse, RedirectResponse, Response

from emaphm.actuator.faults import HEALTHS, degraded_in, health_in
from emaphm.errors import EmaphmError
from emaphm.history.entries import UnitEntries
from emaphm.history.events import KINDS, count_events, read_events
from emaphm.history.views import diagnosis_lines, read_curves
from emaphm.recording.io.read import READERS
from emaphm.server import api
from emaphm.server.access.guard import COOKIE, session_in
from emaphm.server.api import LARGEST_ID, Advice, Health, Id, Kind, Server, Sort
from emaphm.server.fleet import ACTIONS, Choice
from emaphm.server.folders import content_key
from emaphm.server.html import render
from emaphm.server.listing import Listing
from emaphm.server.query import OneOf, check_value
from emaphm.server.state import ServerState
from emaphm.server.uploads import STATED, status_of
from emaphm.server.work.drawing import estimates

router = APIRouter(include_in_schema=False)

STATIC = FilePath(__file__).parent / "static"
FILES = {"style.css": "text/css", "strict.js": "text/javascript", "zoom.js": "text/javascript"}
PLOTLY = "plotly.min.js"

PICTURE = {"content-security-policy": "default-src 'none'; style-src 'unsafe-inline'; sandbox"}
"""Headers of an SVG: only its inline styles are active."""

PageNumber = Annotated[int, Query(ge=1, le=LARGEST_ID)]

MOST_LISTED = 200
"""Largest number of recordings or events on one page."""

FIGURES = ("health", "life", "fan")

RECORDED = ("fit", "residual")
"""Figures of a diagnosis that need its recording: they are drawn and stored at the upload."""

SORT_NAMES = {
    "urgency": "urgency",
    "unit": "unit",
    "part": "part number",
    "rul": "RUL",
    "health": "last diagnosis",
    "hours": "flight hours",
    "last": "last flight added",
    "explained": "share explained",
}
"""Names of the orders that the page offers."""


@router.get("/")
def fleet(
    request: Request,
    server: Server,
    sort: Sort = "urgency",
    order: Annotated[str, OneOf(("asc", "desc"))] = "asc",
    part: str = "",
    advice: Advice = "",
    health: Health = "",
    search: str = "",
    page: PageNumber = 1,
) -> Response:
    """Return the page of the fleet."""
    units = server.fleet.fleet()
    check_value("part", part, units.part_numbers)
    choice = Choice(sort or "urgency", order == "desc", part, advice, health, search[:200])
    key = (units.version, choice, page)
    tag = server.kept.tag(key)
    if request.headers.get("if-none-match") == tag:
        return Response(status_code=304, headers={"etag": tag})
    content = server.kept.pages.get(key, lambda: _fleet(request, server, choice, page))
    return HTMLResponse(content, headers={"etag": tag})


def _fleet(request: Request, server: ServerState, choice: Choice, number: int) -> bytes:
    units = server.fleet.fleet()
    rows = choice.of(units.rows)
    listing = Listing.of(number, server.settings.units_a_page, len(rows))
    filters = {"part": choice.part, "advice": choice.advice, "health": choice.health, "search": choice.search}

    def link(**changes: Any) -> str:
        values = {"sort": choice.sort, "order": "desc" if choice.descending else "asc", **filters, **changes}
        return "/?" + urlencode({name: value for name, value in values.items() if value})

    def sorted_by(name: str) -> str:
        return link(sort=name, order="desc" if name == choice.sort and not choice.descending else "asc")

    counts = {
        "units": len(units.rows),
        **{action: sum(row.advice == action for row in units.rows) for action in ACTIONS},
        "with an alarm": sum(bool(row.alarms) for row in units.rows),
        "without a prognosis": sum(row.advice is None for row in units.rows),
    }
    return render(
        "fleet.html.jinja",
        request,
        rows=rows[listing.start : listing.start + listing.size],
        count=len(rows),
        counts=counts,
        choice=choice,
        sorts=SORT_NAMES,
        actions=ACTIONS,
        healths=HEALTHS,
        parts=units.part_numbers,
        sorted_by=sorted_by,
        listing=listing,
        pages_at=link() + "&page=",
    )


@router.get("/units/{unit_id}")
def unit(request: Request, server: Server, unit_id: Id, page: PageNumber = 1) -> Response:
    """Return the page of a unit; `page` is the page of its recordings."""
    row = api.row_of(server, unit_id)
    listing = Listing.of(page, MOST_LISTED, row.recordings)
    with server.history.database.reading() as connection:  # a consistent state of all tables
        entries = UnitEntries.read(connection, row.id, row.unit)
        lines = diagnosis_lines(connection, unit_id=unit_id, offset=listing.start, limit=listing.size)
        has_curves = read_curves(connection, unit_id) is not None
    lines = tuple(sorted(lines, key=lambda line: (-line.hours, -line.id)))
    kept = api.prognosis_of(server, row)
    return _html(
        "unit.html.jinja",
        request,
        row=row,
        prognosis=kept.document if kept else None,
        made_at=kept.at if kept else None,
        has_curves=has_curves,
        version=_version(kept.at if kept else "", row),
        lines=lines,
        listing=listing,
        entries=entries,
        events=server.history.events(unit=row.unit, newest_first=True, limit=MOST_LISTED),
        most=MOST_LISTED,
        plotly=f"/static/{_plotly_version()}/{PLOTLY}",
        ids={row.unit: row.id},
    )


@router.get("/units/{unit_id}/{name}.svg")
def unit_figure(server: Server, unit_id: Id, name: str, v: str = "", narrow: bool = False) -> Response:
    """Return a figure of a unit's prognosis; `narrow` selects the layout for a phone."""
    if name not in FIGURES:
        raise HTTPException(404, f"no figure '{name[:20]}'")
    document = api.curves(server, unit_id)
    key = ("unit", unit_id, name, hashlib.sha256(json.dumps(document).encode()).hexdigest(), narrow)
    return _picture(server.drawer.figure(key, name, document, narrow=narrow), forever=bool(v))


@router.get("/diagnoses/{diagnosis_id}")
def one_diagnosis(request: Request, server: Server, diagnosis_id: Id) -> Response:
    """Return the page of a diagnosis."""
    row, kept, toml = api.diagnosis_of(server, diagnosis_id)
    return _html(
        "diagnosis.html.jinja",
        request,
        id=diagnosis_id,
        unit=row,
        kept=kept,
        document=kept.document,
        components=estimates(kept.document),
        degraded=degraded_in(kept.document),
        health=health_in(kept.document),
        toml=toml,
        version=content_key(kept),
        has_report=server.folder.report(kept).exists(),
        has_figures=all(server.folder.figure(kept, name).exists() for name in RECORDED),
    )


@router.get("/diagnoses/{diagnosis_id}/report.html")
def report(server: Server, diagnosis_id: Id) -> Response:
    """Return the report of a diagnosis as a file to download."""
    _, kept, _ = api.diagnosis_of(server, diagnosis_id)
    path = server.folder.report(kept)
    if not path.exists():
        raise HTTPException(404, "there is a report only of recordings that were uploaded to this server")
    return FileResponse(path, media_type="text/html", filename=f"diagnosis-{diagnosis_id}.html")


@router.get("/diagnoses/{diagnosis_id}/{name}.svg")
def diagnosis_figure(server: Server, diagnosis_id: Id, name: str, v: str = "") -> Response:
    """Return a figure of a diagnosis, cached for ever if `v` is the diagnosis's `content_key`."""
    _, kept, _ = api.diagnosis_of(server, diagnosis_id)
    key = content_key(kept)
    if name == "faults":
        faults = {"faults": kept.document["faults"]}
        return _picture(server.drawer.figure(("diagnosis", key), name, faults), forever=v == key)
    if name in RECORDED and (path := server.folder.figure(kept, name)).exists():
        return _picture(path.read_bytes(), forever=v == key)
    raise HTTPException(404, f"no figure '{name[:20]}' of diagnosis {diagnosis_id}")


@router.get("/upload")
def upload_form(request: Request, server: Server, unit: str = "") -> Response:
    """Return the page for an upload."""
    return _upload_page(request, server, {"unit": unit[:200]})


@router.post("/upload")
async def upload(request: Request, server: Server) -> Response:
    """Accept an upload and redirect to its page; for a refused upload, show the form with the error."""
    given: dict[str, str] = {}
    try:
        async with server.uploads.form(request) as form:
            given = {name: value[:200] for name, value in form.items() if isinstance(value, str)}
            number = await run_in_threadpool(server.uploads.received, form)
    except EmaphmError as error:
        return await run_in_threadpool(_upload_page, request, server, given, str(error), status_of(error))
    return RedirectResponse(f"/jobs/{number}", status_code=303)


def _upload_page(
    request: Request, server: ServerState, given: dict[str, str], error: str = "", status: int = 200
) -> Response:
    return _html(
        "upload.html.jinja",
        request,
        status,
        given=dict.fromkeys(STATED, "") | given,
        error=error,
        actuators=server.uploads.actuators,
        endings=tuple(READERS),
        most_MiB=server.settings.upload_bytes / 2**20,
        jobs=[api.job_answer(server, entry) for entry in server.queue.jobs(20)],
    )


@router.get("/jobs/{job_id}")
def job(request: Request, server: Server, job_id: Id) -> Response:
    """Return the page of an upload: its progress, then its result."""
    answer = api.job(server, job_id)
    return _html("job.html.jinja", request, job=answer, over=answer.state not in {"waiting", "running"})


@router.get("/data")
def data_health(request: Request, server: Server, page: PageNumber = 1) -> Response:
    """Return the page on unreliable data; `page` is the page of the recordings."""
    listing = Listing.of(page, MOST_LISTED, server.fleet.fleet().recordings(explained=False))
    found = api.untrusted(server, offset=listing.start, limit=listing.size)
    events = server.history.events(
        kinds=(
            "sensor_fault",
            "not_explained",
            "not_like_healthy",
            "hours_behind",
            "refused",
            "rows_skipped",
        ),
        newest_first=True,
        limit=MOST_LISTED,
    )
    return _html(
        "data.html.jinja",
        request,
        found=found,
        listing=listing,
        events=events,
        most=MOST_LISTED,
        ids=server.fleet.ids(),
    )


@router.get("/events")
def events(request: Request, server: Server, kind: Kind = "", page: PageNumber = 1) -> Response:
    """Return the page of the events of all units, the newest first."""
    kinds = (kind,) if kind else ()
    with server.history.database.reading() as connection:
        listing = Listing.of(page, MOST_LISTED, count_events(connection, kinds=kinds))
        listed = read_events(
            connection, kinds=kinds, newest_first=True, offset=listing.start, limit=listing.size
        )
    still_open = [event for event in reversed(server.history.open_conditions()) if kind in ("", event.kind)]
    return _html(
        "events.html.jinja",
        request,
        events=listed,
        still_open=still_open,
        kind=kind,
        kinds=KINDS,
        listing=listing,
        ids=server.fleet.ids(),
    )


@router.get("/login")
def login_form(request: Request) -> Response:
    """Return the page that asks for a token."""
    return _html("login.html.jinja", request, error="")


@router.post("/login")
def login(request: Request, server: Server, token: Annotated[str, Form()] = "") -> Response:
    """Start a session for a browser that sends a valid token."""
    if server.doorkeeper is None:
        return RedirectResponse("/", status_code=303)
    if not server.doorkeeper.accepts(token.strip()):
        return _html("login.html.jinja", request, 401, error="This token is not known.")
    answer = RedirectResponse("/", status_code=303)
    answer.set_cookie(
        COOKIE,
        server.doorkeeper.session(),
        max_age=int(3600 * server.settings.session_hours),
        httponly=True,
        samesite="strict",
        secure=request.url.scheme == "https",
    )
    return answer


@router.post("/logout")
def logout(request: Request, server: Server) -> Response:
    """End the session of a browser."""
    if server.doorkeeper is not None:
        server.doorkeeper.end(session_in(request.headers.get("cookie", "")))
    answer = RedirectResponse("/login", status_code=303)
    answer.delete_cookie(COOKIE)
    return answer


@router.get("/static/{name}")
def static(name: str) -> Response:
    """Return the style of the pages, or the script for zooming figures."""
    if name not in FILES:
        raise HTTPException(404, "no such file")
    return Response((STATIC / name).read_bytes(), media_type=FILES[name])


@router.get(f"/static/{{version}}/{PLOTLY}")
def plotly(version: str) -> Response:
    """Return the script of Plotly, which draws zoomable figures, from its installed package."""
    path = _plotly_file()
    if version != _plotly_version():
        raise HTTPException(404, "another version is installed")
    return FileResponse(path, media_type="text/javascript", headers=FOREVER)


@router.get("/favicon.ico")
def icon() -> Response:
    """Return an empty answer: there is no icon."""
    return Response(status_code=204)


FOREVER = {"cache-control": "private, max-age=31536000, immutable"}


def _plotly_file() -> FilePath:
    spec = find_spec("plotly")
    assert spec is not None  # noqa: S101 - `emaphm.server` checks that it is installed
    assert spec.origin is not None  # noqa: S101 - it is a package in a folder
    return FilePath(spec.origin).parent / "package_data" / PLOTLY


def _plotly_version() -> str:
    from importlib.metadata import version

    return version("plotly")


def _picture(content: bytes, *, forever: bool) -> Response:
    headers = PICTURE | (FOREVER if forever else {})
    return Response(content, media_type="image/svg+xml", headers=headers)


def _html(template: str, request: Request, status: int = 200, **values: Any) -> Response:
    return HTMLResponse(render(template, request, **values), status)


def _version(made_at: str, row: Any) -> str:
    return "".join(c for c in f"{made_at}{row.recordings}" if c.isalnum())
