"""Limits of the server: sizes, times, numbers of processes."""

from dataclasses import dataclass

from emaphm.monitoring.settings import IsolationSettings


@dataclass(frozen=True)
class ServerSettings:
    """Limits of the server, each with its unit and its reason.

    `python -m tests.server.load` and `python -m tests.server.hostile` measure their effects.
    """

    workers: int = 2
    """Processes that diagnose, one upload each: a diagnosis takes one core for some seconds."""

    upload_bytes: int = 64 * 2**20
    """Size of an upload [bytes]: 400,000 rows of 8 columns as CSV, more than a diagnosis accepts."""

    upload_seconds: float = 120.0
    """Time of an upload from its first byte to its last [s]: 64 MiB at 4.5 Mbit/s."""

    uploads_at_once: int = 8
    """Uploads that are received at the same time; a further upload is refused with a request to try again."""

    other_bytes: int = 64 * 2**10
    """Size of the body of any other request [bytes]: a form with a token."""

    other_seconds: float = 10.0
    """Time of the body of any other request from its first byte to its last [s]."""

    most_waiting: int = 200
    """Uploads that wait for a process, at most 12 GiB on disk; a further upload is refused until later."""

    quiet_seconds: float = 2.0
    """Time without an upload of a unit before its waiting uploads are diagnosed, in the order of their hours
    [s].

    Files that a browser or a script sends in succession arrive at intervals of a fraction of a second.
    """

    job_seconds: float = IsolationSettings.seconds
    """Time of a job before its process is ended [s]: the slowest diagnosis of a recording takes a tenth."""

    worker_bytes: int = IsolationSettings.most_bytes
    """Address space of a worker process [bytes]: libraries reserve more than they use."""

    drawing_seconds: float = 60.0
    """Time for drawing a figure [s]; it takes about 1 s."""

    figures_bytes: int = 32 * 2**20
    """Size of the figures cached in memory [bytes]: those of about 100 units."""

    pages_kept: int = 64
    """Rendered pages of the fleet that are cached until something is added: one for each order and filter."""

    connections: int = 256
    """Connections at the same time; a further connection is refused."""

    session_hours: float = 12.0
    """Time after which a browser must log in again [h]: a shift."""

    units_a_page: int = 1000
    """Units on one page of the fleet."""


SETTINGS = ServerSettings()
