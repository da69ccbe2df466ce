"""Start and end of the server: its socket, folder and processes."""

import ipaddress
import logging
import signal
import socket
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from emaphm.errors import ServerError
from emaphm.history import History
from emaphm.memory import Memory
from emaphm.monitoring.delivery import Delivery, Receiver, close_all
from emaphm.monitoring.receivers import Webhook
from emaphm.monitoring.settings import WATCH, PrognosisSettings
from emaphm.monitoring.watch_state import WatchState
from emaphm.server.access.tokens import Doorkeeper, read_tokens
from emaphm.server.app import create_app, warm_up
from emaphm.server.fleet import FleetView
from emaphm.server.folders import ServerFolder
from emaphm.server.html import check_templates
from emaphm.server.settings import SETTINGS, ServerSettings
from emaphm.server.state import Kept, ServerState
from emaphm.server.uploads import Uploads
from emaphm.server.work.drawing import Drawer
from emaphm.server.work.pool import Pool
from emaphm.server.work.queue import Queue
from emaphm.server.work.worker import SERVER, Place

if TYPE_CHECKING:
    import uvicorn
    from fastapi import FastAPI

    from emaphm.actuator import Actuator
    from emaphm.detection import Detector

LOG = logging.getLogger("emaphm.server")

MOST_PENDING = 2048
"""Largest number of connections that the system queues until the server accepts them."""


def serve(
    db: str,
    *,
    host: str = "127.0.0.1",
    port: int = 8000,
    tokens: Path | None = None,
    work: Path | None = None,
    actuators: Sequence[str] = ("thesis",),
    healthy: Path | None = None,
    webhook: str | None = None,
    templates: Path | None = None,
    prognosis: PrognosisSettings = WATCH.prognosis,
    settings: ServerSettings = SETTINGS,
    seed: int = 0,
    on_ready: Callable[[str], None] = lambda _: None,
) -> None:
    """Serve the history at `db` until the process is interrupted, or ended by SIGTERM.

    Parameters
    ----------
    db
        Address of the history.
    host, port
        Address of the server; port 0 selects any free port. An address other than localhost requires
        `tokens`.
    tokens
        A file of hashed tokens (`emaphm.server.access.tokens.add_token`).
    work
        The server's folder; if omitted, it is next to the file of the history.
    actuators
        Descriptions that an upload may name: files, or built-in actuators.
    healthy
        A file of `emaphm detect learn`: uploads are also compared with healthy recordings.
    webhook
        An address to which the events of this server are sent, as `emaphm.monitoring` does.
    templates
        A folder of Jinja2 templates that replace the package's templates of the same names.
    prognosis
        Thresholds from which a remaining useful life raises an event.
    settings
        Limits of the server.
    seed
        Source of all randomness of diagnoses and prognoses.
    on_ready
        Called with the address of the first page when the server is ready.

    Raises
    ------
    ServerError
        The address cannot be used or requires tokens, another server uses the folder, or a template has an
        error.
    MonitoringError
        The webhook is no address.
    HistoryError
        The database cannot be opened.
    """
    only_loopback = _is_loopback(host)
    if not only_loopback and tokens is None:
        raise ServerError(
            f"--host {host} lets other machines in; make a token first, with --tokens FILE --add-token NAME, "
            "and give --tokens FILE"
        )
    known = None if tokens is None else read_tokens(tokens)
    detector = None if healthy is None else _detector(healthy)
    if templates is not None:
        check_templates(templates)
    receiver = None if webhook is None else Webhook(webhook, WATCH.delivery.timeout_s)
    with _ended_by_sigterm(), ExitStack() as stack:
        listening = stack.enter_context(_listening(host, port))
        state = stack.enter_context(
            running(
                db,
                known,
                work,
                described(actuators),
                settings,
                detector=detector,
                receiver=receiver,
                prognosis=prognosis,
                templates=templates,
                seed=seed,
            )
        )
        app = create_app(state, only_loopback=only_loopback)
        warm_up(app)
        web_server = _web_server(app, settings)
        name = f"[{host}]" if ":" in host else host
        on_ready(f"http://{name}:{listening.getsockname()[1]}/")
        web_server.run(sockets=[listening])


def _web_server(app: "FastAPI", settings: ServerSettings) -> "uvicorn.Server":
    import uvicorn

    from emaphm.server.access.connection import ImpatientProtocol

    logging.getLogger("python_multipart").setLevel(logging.ERROR)  # not for clients' invalid forms
    return uvicorn.Server(
        uvicorn.Config(
            app,
            http=ImpatientProtocol,
            log_level="warning",
            access_log=False,
            server_header=False,
            proxy_headers=False,
            lifespan="off",
            limit_concurrency=settings.connections,
            timeout_graceful_shutdown=5,
        )
    )


@contextmanager
def running(
    db: str,
    tokens: Mapping[str, str] | None,
    work: Path | None,
    actuators: "Mapping[str, Actuator]",
    settings: ServerSettings = SETTINGS,
    *,
    detector: "Detector | None" = None,
    receiver: Receiver | None = None,
    prognosis: PrognosisSettings = WATCH.prognosis,
    templates: Path | None = None,
    seed: int = 0,
) -> Iterator[ServerState]:
    """Yield the state of the pages, with the processes running during the body; errors as in `serve`."""
    with History.open(db) as history:
        folder = ServerFolder(work or _default_folder(history))
        with ExitStack() as stack:
            stack.enter_context(folder.locked())
            queue = Queue(folder.queue)
            stack.callback(queue.close)
            drawer = Drawer(settings)
            stack.callback(drawer.stop)
            fleet = FleetView(history)
            on_new_events = stack.enter_context(_event_delivery(history, receiver))
            place = Place(
                db=db,
                folder=folder,
                actuators=dict(actuators),
                memory_bytes=settings.worker_bytes,
                upload_bytes=settings.upload_bytes,
                detector=detector,
                prognosis=prognosis,
                seed=seed,
            )
            pool = Pool(queue, place, settings, fleet.outdated, fleet.forecast, on_new_events)
            pool.start()
            stack.callback(pool.stop)
            yield ServerState(
                history=history,
                folder=folder,
                queue=queue,
                pool=pool,
                drawer=drawer,
                fleet=fleet,
                uploads=Uploads(history, folder, queue, pool, tuple(actuators), settings.most_waiting),
                doorkeeper=None if tokens is None else Doorkeeper(dict(tokens), settings.session_hours),
                settings=settings,
                kept=Kept(Memory(settings.pages_kept)),
                templates=templates,
            )


@contextmanager
def _event_delivery(history: History, receiver: Receiver | None) -> Iterator[Callable[[], None]]:
    """Yield the function to call when there may be new events, which are sent during the body."""
    if receiver is None:
        yield lambda: None
        return
    events = WatchState(history, SERVER)
    events.skip_to_now(receiver.key)
    delivery = Delivery(receiver, events, WATCH.delivery, LOG.warning)
    try:
        yield delivery.wake
    finally:
        close_all([delivery])


@contextmanager
def _ended_by_sigterm() -> Iterator[None]:
    """End the body on SIGTERM, so that its contexts are closed; only the main thread receives signals."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(*_: object) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        raise _TerminatedError

    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    except _TerminatedError:
        pass
    finally:
        signal.signal(signal.SIGTERM, before)


class _TerminatedError(Exception):
    """SIGTERM was received."""


def described(names: Sequence[str]) -> "dict[str, Actuator]":
    """Return the descriptions that uploads may name, by the names of the actuators.

    Raises
    ------
    ServerError
        Two descriptions have the same name.
    ActuatorError
        A description cannot be read.
    """
    from emaphm.actuator import Actuator

    result: dict[str, Actuator] = {}
    for name in names:
        actuator = Actuator.load(name)
        if actuator.name in result:
            raise ServerError(f"two descriptions are called '{actuator.name}'; rename one of them")
        result[actuator.name] = actuator
    return result


def _detector(path: Path) -> "Detector":
    from emaphm.detection import Detector

    return Detector.load(path)


def _default_folder(history: History) -> Path:
    file = history.database.address.file
    if file is None:
        raise ServerError("a history on a server has no folder; give one with --work, for uploads that wait")
    return file.absolute().with_name(f"{file.name}.serve")


def _is_loopback(host: str) -> bool:
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


@contextmanager
def _listening(host: str, port: int) -> Iterator[socket.socket]:
    if not 0 <= port < 2**16:
        raise ServerError(f"--port {port}: give a number from 0 to 65535")
    with ExitStack() as stack:
        try:
            family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
            listener = stack.enter_context(socket.socket(family, socket.SOCK_STREAM))
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind(address)
            listener.listen(MOST_PENDING)
        except (OSError, UnicodeError) as error:
            reason = getattr(error, "strerror", None) or error
            raise ServerError(
                f"{host}:{port} cannot be used ({reason}); give another --port, or end what uses it"
            ) from None
        yield listener
