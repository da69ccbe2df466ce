"""What bounds the server: sizes, times, numbers of processes."""

from dataclasses import dataclass

from emaphm.monitoring.settings import IsolationSettings


@dataclass(frozen=True)
class ServerSettings:
    """Bounds of the server, each with its unit and its reason.

    `python -m tests.server.load` and `python -m tests.server.hostile` measure what they lead to.
    """

    workers: int = 2
    """Processes that diagnose, one upload each: a diagnosis takes one core for some seconds."""

    upload_bytes: int = 64 * 2**20
    """Of an upload [bytes]: 400,000 rows of 8 columns as CSV, more than a diagnosis takes."""

    upload_seconds: float = 120.0
    """Of an upload, from its first byte to its last [s]: 64 MiB at 4.5 Mbit/s."""

    uploads_at_once: int = 8
    """Uploads that are received at the same time; a further one is asked to come again."""

    other_bytes: int = 64 * 2**10
    """Of any other request's body [bytes]: a form with a token."""

    other_seconds: float = 10.0
    """Of any other request's body, from its first byte to its last [s]."""

    most_waiting: int = 200
    """Uploads that wait for a process: 12 GiB on disk at most. A further one is asked to come again."""

    quiet_seconds: float = 2.0
    """Without an upload of a unit, until those that wait are diagnosed in the order of their hours [s].

    Files that a browser or a script sends one after the other come at intervals of a fraction of a second.
    """

    job_seconds: float = IsolationSettings.seconds
    """Of a job [s], whose process is then ended: the slowest diagnosis of a recording takes a tenth."""

    worker_bytes: int = IsolationSettings.most_bytes
    """Address space of a worker process [bytes]: libraries reserve more than they use."""

    drawing_seconds: float = 60.0
    """Of a figure [s]; it takes about one."""

    figures_bytes: int = 32 * 2**20
    """Figures that are kept in memory [bytes]: those of some 100 units."""

    pages_kept: int = 64
    """Rendered pages of the fleet that are kept until something is added: one for each order and filter."""

    connections: int = 256
    """Connections at the same time; a further one is refused."""

    session_hours: float = 12.0
    """After which a browser must log in again [h]: a shift."""

    units_a_page: int = 1000
    """Units on one page of the fleet; further ones are on the next."""


SETTINGS = ServerSettings()
