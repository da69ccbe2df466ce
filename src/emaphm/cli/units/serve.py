"""`emaphm serve`: the history as web pages and as an HTTP API."""

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
    """Where the server listens."""

    host: Annotated[
        str, Parameter(help="Address to listen at; any but this machine's own needs --tokens.")
    ] = "127.0.0.1"
    port: Annotated[
        int, Parameter(converter=whole_number, help="Port to listen at; 0 is any that is free.")
    ] = 8000


@Parameter(name="*")
@dataclass(frozen=True)
class Access:
    """Who is let in."""

    tokens: Annotated[
        Path | None, Parameter(help="File of hashed tokens; who has one of them is let in.")
    ] = None
    add_token: Annotated[
        str | None, Parameter(help="Add a token of this name to --tokens, print it, and end.")
    ] = None


@Parameter(name="*")
@dataclass(frozen=True)
class Receiving:
    """Where uploads are kept, and what they are compared with."""

    work: Annotated[
        Path | None,
        Parameter(
            help="Folder for the queue, uploads and reports; next to the history's file if left out. "
            "Required with PostgreSQL."
        ),
    ] = None
    healthy: Annotated[
        Path | None, Parameter(help="Detector that 'detect learn' wrote: uploads are compared with it too.")
    ] = None


@Parameter(name="*")
@dataclass(frozen=True)
class Sending:
    """What makes an event, and where events are sent."""

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
            help="TOML description that uploads may name, or a built-in one; may be repeated.",
        ),
    ] = ("thesis", "pmsm"),
    access: Access = Access(),
    receiving: Receiving = Receiving(),
    templates: Annotated[
        Path | None, Parameter(help="Folder of Jinja2 templates that take the place of the program's pages.")
    ] = None,
    sending: Sending = Sending(),
    workers: Annotated[
        int, Parameter(converter=whole_number, help="Processes that diagnose uploads, one upload each.")
    ] = 2,
    seed: Seed = 0,
    as_json: AsJson = False,
) -> None:
    """Show the fleet, its units and diagnoses as web pages, and take uploads, until interrupted."""
    if access.add_token is not None:
        _add_token(access.tokens, access.add_token, as_json)
        return
    check_seed(seed)
    if workers < 1:
        raise ServerError(f"--workers {workers}: give 1 or more")
    from emaphm.server.run import serve as run
    from emaphm.server.settings import SETTINGS

    def ready(url: str) -> None:
        line = f"{url} shows the history; Ctrl-C ends it"
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
        raise ServerError("--add-token: say which file it goes to, with --tokens FILE")
    token = add_token(file, name)
    text = f"{token}\nThis is the token of '{name}'; it is shown once, {file} holds its hash."
    show({"name": name, "token": token, "file": str(file)}, text, as_json)
