"""A pool of worker processes: a thread sends jobs to each, and restarts it when it dies."""

import logging
import threading
import time
from collections.abc import Callable
from typing import Any, TypeVar

from emaphm.errors import EmaphmError, ServerError
from emaphm.execution.one_process import OneProcess
from emaphm.server.settings import ServerSettings
from emaphm.server.work.queue import AGAIN, DONE, FAILED, Job, Queue
from emaphm.server.work.worker import Forecast, JobOutcome, Place, Upload, unexpected, work

T = TypeVar("T")

LOG = logging.getLogger("emaphm.server")

MOST_KILLS = 2
"""Number of killed processes after which a job fails: it is tried again once."""

IDLE_S = 1.0
"""Time between two checks of the queue [s]; an upload ends the wait."""

AGAIN_S = 5.0
"""Time until a job or a prognosis is tried again after the history was not available [s]."""

TOO_LONG = "took longer than {:g} s; cut one manoeuvre out of the recording"
KILLED = "the process that diagnosed it was killed twice; cut one manoeuvre out of the recording"


class Pool:
    """Processes that execute the jobs of a queue, and prognoses from `spare` when there is no job.

    Parameters
    ----------
    queue
        Queue of jobs.
    place
        Paths and settings of the workers.
    settings
        Limits of the server.
    spare
        Returns the serial number of a unit whose prognosis is out of date, None if there is none.
    on_forecast
        Called with the serial number and the state when a prognosis has ended: done, refused, failed, or
        again, if the history was not available or the process has died for the first time.
    on_news
        Called when a job or a prognosis may have added events.
    """

    def __init__(
        self,
        queue: Queue,
        place: Place,
        settings: ServerSettings,
        spare: Callable[[], str | None],
        on_forecast: Callable[[str, str], None],
        on_news: Callable[[], None] = lambda: None,
    ) -> None:
        self._queue = queue
        self._place = place
        self._settings = settings
        self._spare = spare
        self._on_forecast = on_forecast
        self._on_news = on_news
        self._progress: dict[int, float] = {}
        self._killed: set[str] = set()  # units whose prognosis has killed a process once
        self._stopping = False
        self._woken = threading.Condition()
        # One process remains free of prognoses, so that uploads need not wait, unless it is the only one.
        self._forecasts = threading.Semaphore(max(settings.workers - 1, 1))
        self._threads = [
            threading.Thread(target=self._feed, name=f"worker {i}", daemon=True)
            for i in range(settings.workers)
        ]

    def start(self) -> None:
        """Start the processes; jobs that were running when the last server ended wait again."""
        self._queue.resume()
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """End the processes; running jobs wait for the next server."""
        with self._woken:
            self._stopping = True
            self._woken.notify_all()
        for thread in self._threads:
            thread.join()
        self._queue.resume()

    def wake(self) -> None:
        """Check the queue at once."""
        with self._woken:
            self._woken.notify()

    def progress(self, job: int) -> float:
        """Return the share of a running job that is done, 0 to 1."""
        return self._progress.get(job, 0.0)

    def _feed(self) -> None:
        """Send jobs to one process until the pool stops."""
        process = OneProcess(work, self._place)
        try:
            while not self._stopping:
                try:
                    has_worked = self._next(process)
                except EmaphmError as error:  # the disk of the queue is full, or the history not available
                    LOG.warning("%s", error)
                    has_worked = False
                except Exception:
                    LOG.exception("a defect of emaphm; the server goes on")
                    process.end()  # its pending answer must not be taken for that of the next job
                    has_worked = False
                if not has_worked:
                    self._wait(IDLE_S)
        finally:
            process.end()

    def _next(self, process: OneProcess) -> bool:
        """Execute one job or prognosis; return whether there was one."""
        job = self._queue.take(self._settings.quiet_seconds)
        if job is not None:
            self._upload(job, process)
            return True
        if not self._forecasts.acquire(blocking=False):
            return False
        try:
            unit = self._spare()
            if unit is None:
                return False
            self._forecast(unit, process)
            return True
        finally:
            self._forecasts.release()

    def _wait(self, seconds: float) -> None:
        """Wait until there is an upload or the pool stops, for at most `seconds` [s]."""
        with self._woken:
            if not self._stopping:
                self._woken.wait(seconds)

    def _forecast(self, unit: str, process: OneProcess) -> None:
        outcome = self._outcome(process, Forecast(unit), lambda _: None)
        if self._stopping:
            return
        if outcome is None:
            outcome = JobOutcome(FAILED if unit in self._killed else AGAIN, "its process has died")
            self._killed.add(unit)
        if outcome.state != AGAIN:
            self._killed.discard(unit)
        if outcome.state != DONE:
            LOG.warning("no prognosis of %r: %s", unit, outcome.message)
        if outcome.state == AGAIN:
            self._wait(AGAIN_S)
        self._on_forecast(unit, outcome.state)
        self._on_news()

    def _upload(self, job: Job, process: OneProcess) -> None:
        order = Upload(self._place.folder.upload(job.file), job.request["name"], job.request)
        try:
            outcome = self._outcome(process, order, lambda share: self._progress.__setitem__(job.id, share))
        except Exception as error:
            LOG.exception("job %d: a defect of emaphm", job.id)
            process.end()  # its pending answer must not be taken for that of the next job
            outcome = JobOutcome(FAILED, unexpected(error))
        self._progress.pop(job.id, None)
        if self._stopping and outcome is None:
            return
        if outcome is None:
            LOG.warning("job %d: its process has died", job.id)
            if self._written(lambda: self._queue.killed(job.id)) < MOST_KILLS:
                return
            outcome = JobOutcome(FAILED, KILLED)
        if outcome.state == AGAIN:
            LOG.warning("job %d: %s; it is tried again", job.id, outcome.message)
            self._written(lambda: self._queue.again(job.id))
            self._wait(AGAIN_S)
            return
        ended = outcome
        self._written(lambda: self._queue.end(job.id, ended.state, ended.message, ended.result))
        self._on_news()
        if outcome.state != FAILED:  # the file of a failed job is kept for inspection
            order.file.unlink(missing_ok=True)

    def _written(self, write: Callable[[], T]) -> T:
        """Return the result of writing to the queue, which is repeated while its disk is full.

        Otherwise the job would count as running, and no other job of its unit would be taken.
        """
        while not self._stopping:
            try:
                return write()
            except ServerError as error:
                LOG.warning("%s", error)
                self._wait(AGAIN_S)
        return write()

    def _outcome(
        self, process: OneProcess, order: Any, on_progress: Callable[[float], None]
    ) -> JobOutcome | None:
        """Return the outcome of an order, None if the process has died or the pool stops."""
        deadline = time.monotonic() + self._settings.job_seconds
        try:
            process.send(order)
            while not self._stopping:
                if not process.orders.poll(IDLE_S):
                    if time.monotonic() > deadline:
                        process.end()
                        return JobOutcome(FAILED, TOO_LONG.format(self._settings.job_seconds))
                    continue
                answer = process.orders.recv()
                if isinstance(answer, JobOutcome):
                    return answer
                on_progress(float(answer))
        except (EOFError, OSError):
            process.end()
        return None
