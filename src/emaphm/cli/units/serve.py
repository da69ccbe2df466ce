"""`emaphm serve`: the history as web pages and as an HTTP API."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from emaphm.cli.options import AsJson, whole_number
from emaphm.cli.output import show, show_at_once, show_line
from emaphm.cli.units.events import Horizon, Risk, WebhookAddress, prognosis_settings
from emaphm.cli.units.history import DB, Database
from emaphm.errors import ServerError


def serve(
    *,
    db: Database = DB,
    host: Annotated[
        str, Parameter(help="Address to listen at; any but this machine's own needs --tokens.")
    ] = "127.0.0.1",
    port: Annotated[
        int, Parameter(converter=whole_number, help="Port to listen at; 0 is any that is free.")
    ] = 8000,
    actuator: Annotated[
        tuple[str, ...],
        Parameter(
            negative="",
            show_default=", ".join,
            help="TOML description that uploads may name, or a built-in one; may be repeated.",
        ),
    ] = ("thesis", "pmsm"),
    tokens: Annotated[
        Path | None, Parameter(help="File of hashed tokens; who has one of them is let in.")
    ] = None,
    add_token: Annotated[
        str | None, Parameter(help="Add a token of this name to --tokens, print it, and end.")
    ] = None,
    work: Annotated[
        Path | None,
        Parameter(
            help="Folder for the queue, uploads and reports; next to the history's file if left out. "
            "Required with PostgreSQL."
        ),
    ] = None,
    healthy: Annotated[
        Path | None, Parameter(help="Detector that 'detect learn' wrote: uploads are compared with it too.")
    ] = None,
    templates: Annotated[
        Path | None, Parameter(help="Folder of Jinja2 templates that take the place of the program's pages.")
    ] = None,
    horizon: Horizon = 200.0,
    risk: Risk = 0.05,
    webhook: WebhookAddress = None,
    workers: Annotated[
        int, Parameter(converter=whole_number, help="Processes that diagnose uploads, one upload each.")
    ] = 2,
    as_json: AsJson = False,
) -> None:
    """Show the fleet, its units and diagnoses as web pages, and take uploads, until interrupted."""
    from dataclasses import replace

    if add_token is not None:
        from emaphm.server.tokens import add_token as add

        if tokens is None:
            raise ServerError("--add-token: say which file it goes to, with --tokens FILE")
        token = add(tokens, add_token)
        shown = f"{token}\nThis is the token of '{add_token}'; it is shown once, {tokens} holds its hash."
        show({"name": add_token, "token": token, "file": str(tokens)}, shown, as_json)
        return
    if workers < 1:
        raise ServerError(f"--workers {workers}: give 1 or more")
    from emaphm.server.run import serve as run
    from emaphm.server.settings import SETTINGS

    def ready(url: str) -> None:
        show_line({"url": url}) if as_json else show_at_once(f"{url} shows the history; Ctrl-C ends it")

    run(
        db,
        host=host,
        port=port,
        tokens=tokens,
        work=work,
        actuators=actuator,
        healthy=healthy,
        webhook=webhook,
        templates=templates,
        prognosis=prognosis_settings(horizon, risk),
        settings=replace(SETTINGS, workers=workers),
        on_ready=ready,
    )
