"""The verb `serve`: the history as web pages and as an HTTP API."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from emaphm.cli.options import AsJson, Seed, check_seed, whole_number
from emaphm.cli.output import say, show, show_at_once, show_line
from emaphm.cli.units.events import FailureEvents, WebhookAddress
from emaphm.cli.units.history_options import DB, Database
from emaphm.errors import ServerError


@Parameter(name="*")
@dataclass(frozen=True)
class Address:
    """Address and port of the server."""

    host: Annotated[
        str,
        Parameter(
            help="Address at which the server listens; an address other than localhost needs --tokens."
        ),
    ] = "127.0.0.1"
    port: Annotated[
        int,
        Parameter(converter=whole_number, help="Port at which the server listens; 0 selects a free port."),
    ] = 8000


@Parameter(name="*")
@dataclass(frozen=True)
class Access:
    """Access control by tokens."""

    tokens: Annotated[
        Path | None, Parameter(help="File of hashed access tokens; requests need one of these tokens.")
    ] = None
    add_token: Annotated[
        str | None,
        Parameter(help="Add an access token of this name to the file --tokens, print it, and end."),
    ] = None


@Parameter(name="*")
@dataclass(frozen=True)
class UploadOptions:
    """Folder of the uploads, and the detector that checks them."""

    work: Annotated[
        Path | None,
        Parameter(
            help="Folder for the queue, uploads and reports; default next to the history's SQLite file, "
            "required with PostgreSQL."
        ),
    ] = None
    healthy: Annotated[
        Path | None,
        Parameter(
            help="Detector written by 'emaphm detect learn', .json: also decide whether uploads are like "
            "healthy recordings."
        ),
    ] = None


@Parameter(name="*")
@dataclass(frozen=True)
class EventOptions:
    """Conditions of events, and the address to which events are sent."""

    failure_events: FailureEvents = FailureEvents()  # noqa: RUF009 - frozen
    webhook: WebhookAddress = None


def serve(
    *,
    db: Database = DB,
    address: Address = Address(),
    actuator: Annotated[
        tuple[str, ...],
        Parameter(
            negative="",
            show_default=", ".join,
            help="TOML description of an actuator, or the name of a built-in one, that uploads may select; "
            "may be repeated.",
        ),
    ] = ("thesis", "pmsm"),
    access: Access = Access(),
    receiving: UploadOptions = UploadOptions(),
    templates: Annotated[
        Path | None, Parameter(help="Folder of Jinja2 templates that replace the built-in pages.")
    ] = None,
    sending: EventOptions = EventOptions(),
    workers: Annotated[
        int,
        Parameter(
            converter=whole_number,
            help="Number of processes that diagnose uploads, each one upload at a time.",
        ),
    ] = 2,
    seed: Seed = 0,
    as_json: AsJson = False,
) -> None:
    """Serve the fleet, its units and diagnoses as web pages, and accept uploads, until interrupted."""
    if access.add_token is not None:
        _add_token(access.tokens, access.add_token, as_json)
        return
    check_seed(seed)
    if workers < 1:
        raise ServerError(f"--workers {workers}: give 1 or more")
    from emaphm.server.run import serve as run
    from emaphm.server.settings import SETTINGS

    def ready(url: str) -> None:
        line = f"{url} shows the history; Ctrl-C ends the server"
        if not (show_line({"url": url}) if as_json else show_at_once(line)):
            say(line)

    run(
        db,
        host=address.host,
        port=address.port,
        tokens=access.tokens,
        work=receiving.work,
        actuators=actuator,
        healthy=receiving.healthy,
        webhook=sending.webhook,
        templates=templates,
        prognosis=sending.failure_events.settings(),
        settings=replace(SETTINGS, workers=workers),
        seed=seed,
        on_ready=ready,
    )


def _add_token(file: Path | None, name: str, as_json: bool) -> None:
    from emaphm.server.access.tokens import add_token

    if file is None:
        raise ServerError("--add-token: name the file of the tokens with --tokens FILE")
    token = add_token(file, name)
    text = f"{token}\nThis is the token of '{name}'. It is shown only once; {file} contains its hash."
    show({"name": name, "token": token, "file": str(file)}, text, as_json)
