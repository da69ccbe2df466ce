"""The web application: pages, API, error answers and middleware."""

from http import HTTPStatus
from typing import TYPE_CHECKING

from fastapi import Depends, FastAPI, Request
from fastapi.encoders import jsonable_encoder
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.gzip import GZipMiddleware
from starlette.responses import HTMLResponse, JSONResponse, Response

from emaphm.errors import EmaphmError
from emaphm.server import api, pages
from emaphm.server.access.guard import HEADERS, Guard
from emaphm.server.html import render
from emaphm.server.query import check_query, in_words
from emaphm.server.uploads import BusyError, status_of
from emaphm.version import VERSION

if TYPE_CHECKING:
    from emaphm.server.state import ServerState

SMALLEST_ZIPPED = 1000
"""Smallest answer that is compressed [bytes]."""


NO_ROUTE = "there is nothing at this address; /openapi.json lists those of the API"


def create_app(state: "ServerState", *, only_loopback: bool = True) -> FastAPI:
    """Return the application.

    Parameters
    ----------
    state
        State that all requests share.
    only_loopback
        Whether requests must address this machine as localhost, so that no other host name leads here.
    """
    app = FastAPI(
        title="emaphm",
        description="Health and remaining useful life of electromechanical actuators.",
        version=VERSION,
        openapi_url="/openapi.json",
        docs_url=None,  # its scripts would come from another site
        redoc_url=None,
        dependencies=[Depends(check_query)],
        middleware=[
            Middleware(
                Guard, settings=state.settings, doorkeeper=state.doorkeeper, only_loopback=only_loopback
            ),
            Middleware(GZipMiddleware, minimum_size=SMALLEST_ZIPPED, compresslevel=4),
        ],
    )
    app.state.server = state
    app.include_router(api.router)
    app.include_router(pages.router)
    app.add_exception_handler(HTTPException, _http)
    app.add_exception_handler(RequestValidationError, _invalid)
    app.add_exception_handler(EmaphmError, _refused)
    app.add_exception_handler(Exception, _defect)
    return app


def warm_up(app: FastAPI) -> None:
    """Render the page of the fleet once, so that the first request does not wait for it."""
    pages.fleet(Request({"type": "http", "app": app, "headers": []}), app.state.server)


def _answer(request: Request, status: int, text: str, headers: dict[str, str] | None = None) -> Response:
    if request.url.path.startswith("/api/"):
        return JSONResponse({"detail": text}, status, headers)
    return HTMLResponse(render("error.html.jinja", request, status=status, text=text), status, headers)


def _http(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)  # noqa: S101 - it is registered for these
    text = NO_ROUTE if error.detail == HTTPStatus.NOT_FOUND.phrase else str(error.detail)
    return _answer(request, error.status_code, text, dict(error.headers or {}))


def _invalid(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)  # noqa: S101 - it is registered for these
    if request.url.path.startswith("/api/"):
        details = [{key: entry[key] for key in ("loc", "msg", "type")} for entry in error.errors()]
        return JSONResponse({"detail": jsonable_encoder(details)}, 422)
    query_errors = [in_words(entry) for entry in error.errors() if entry["loc"][0] == "query"]
    if query_errors:
        return _answer(request, 422, f"The address cannot be used as it is: {'; '.join(query_errors)}.")
    return _answer(request, 404, "There is no such page.")


def _refused(request: Request, error: Exception) -> Response:
    if isinstance(error, BusyError):
        return _answer(request, 503, str(error), {"retry-after": "30"})
    return _answer(request, status_of(error), str(error))


def _defect(request: Request, error: Exception) -> Response:
    del error  # it is in the log
    # This answer does not pass the guard, which adds the headers otherwise.
    return _answer(request, 500, "A defect of emaphm; its log has the details.", HEADERS)
