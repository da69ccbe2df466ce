"""The monitoring loop: arrivals are judged, history and prognoses updated, events sent."""

import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

from emaphm.actuator import Actuator
from emaphm.errors import EmaphmError, HistoryFormError, HistoryUnavailableError, MonitoringError
from emaphm.execution.one_process import Calls, EndedError, StoppedError
from emaphm.history import Entry, Event, History
from emaphm.monitoring.arrival import Arrival, Call, Source, call_here
from emaphm.monitoring.delivery import Delivery, Receiver, close_all
from emaphm.monitoring.diagnosers import load, refusal_of
from emaphm.monitoring.folder import FolderSource
from emaphm.monitoring.judging import Judge
from emaphm.monitoring.outlook import NoPrognosisError, Outlook
from emaphm.monitoring.pressure import Pressure
from emaphm.monitoring.receivers import Lines, Webhook
from emaphm.monitoring.settings import WATCH, IsolationSettings, WatchSettings
from emaphm.monitoring.stream.source import StreamSource
from emaphm.monitoring.task import WatchTask
from emaphm.monitoring.watch_state import JUDGED, PARTLY, REFUSED, SET_ASIDE, WatchState
from emaphm.recording import Recording
from emaphm.text_table import counted

T = TypeVar("T")

IDLE_S = 0.05
"""Pause if there is nothing to do [s]."""

TOO_MUCH_MEMORY = "it takes more memory than it may have; cut one manoeuvre out of it"

NOT_AGAIN = "it is set aside and not tried again; cut one manoeuvre out of it, as a new recording"


@dataclass
class Watching:
    """Counts of a run: recordings judged, already in the history, files or parts refused, and prognoses.

    For a stream, also the number of rows that were left out.
    """

    judged: int = 0
    known: int = 0
    refused: int = 0
    prognoses: int = 0
    rows_left_out: int = 0

    def __str__(self) -> str:
        left_out = f", {counted(self.rows_left_out, 'row')} left out" if self.rows_left_out else ""
        return (
            f"{counted(self.judged, 'recording')} diagnosed, {self.known} already in the history, "
            f"{self.refused} refused{left_out}; {counted(self.prognoses, 'prognosis', 'prognoses')}"
        )


def watch(
    task: WatchTask,
    history: History,
    actuator: Actuator,
    *,
    settings: WatchSettings = WATCH,
    stop: threading.Event | None = None,
    say: Callable[[str], None] = lambda _: None,
    on_count: Callable[[int, int], None] | None = None,
) -> Watching:
    """Monitor a source until it ends, `stop` is set, or the reader of the events closes.

    Parameters
    ----------
    task
        Definition of the monitoring task.
    history
        Open history, in which diagnoses, prognoses, events and the progress of the watcher are stored.
    actuator
        Description of the actuator for all diagnoses.
    settings
        Times, sizes and thresholds of events.
    stop
        When it is set, the running diagnosis has `settings.isolation.last_s` [s] to end; else it is cancelled
        and repeated at the next start.
    say
        Called with messages for a person that are no events: the history cannot be reached, a webhook does
        not answer.
    on_count
        Called with the number of judged recordings, and with that number plus the waiting recordings.

    Raises
    ------
    MonitoringError
        The source or the webhook cannot be used.
    HistoryFormError
        A newer version of emaphm has changed the history meanwhile.
    """
    task.check()
    stop = stop or threading.Event()
    webhook = None if task.webhook is None else Webhook(task.webhook, settings.delivery.timeout_s)
    state = WatchState(history, task.watcher)
    open_conditions = history.open_conditions()
    raised = {event.kind for event in open_conditions if event.watcher == task.watcher and event.unit is None}
    done = Watching()
    with suppress(StoppedError), ExitStack() as stack:
        call = stack.enter_context(_isolated(settings.isolation, stop)) if task.isolated else call_here
        source = _source(task, actuator, state, settings, call, is_lost="source_lost" in raised)
        stack.callback(source.close)
        lines = [] if task.lines is None else [Lines(task.lines)]
        if webhook is not None:
            state.skip_to_now(webhook.key)
        receivers: list[Receiver] = [*lines, *([] if webhook is None else [webhook])]
        deliveries = [Delivery(receiver, state, settings.delivery, say) for receiver in receivers]
        stack.callback(close_all, deliveries)
        isolation = settings.isolation if task.isolated else None
        outlook = Outlook(history, settings.prognosis, task.seed, task.watcher, isolation)
        stack.callback(outlook.close)
        pressure = Pressure(settings.pressure, task.watcher, is_raised="back_pressure" in raised)
        watcher = _Watcher(
            source=source,
            history=history,
            judge=_judge(task, history, actuator, settings, call),
            outlook=outlook,
            pressure=pressure,
            deliveries=deliveries,
            settings=settings,
            stop=stop,
            say=say,
            on_count=on_count,
            done=done,
        )
        watcher.run(once=task.once or isinstance(task.source, int), ends=lambda: _closed(lines))
    return done


@contextmanager
def _isolated(settings: IsolationSettings, stop: threading.Event) -> Iterator[Call]:
    """Yield an interface that calls functions in a separate process, which ends with the body."""
    calls = Calls(settings.seconds, settings.most_bytes, stop, settings.last_s)
    try:
        calls(load)  # else the imports would count as time of the first recording
        yield calls
    except EndedError as error:
        raise MonitoringError(
            f"the process that judges recordings cannot be started: {error}; free memory, then start again "
            "(in a script of your own: is it guarded by `if __name__ == '__main__':`?)"
        ) from None
    finally:
        calls.end()


def _closed(receivers: Sequence[Lines]) -> bool:
    return any(receiver.is_closed for receiver in receivers)


def _judge(
    task: WatchTask, history: History, actuator: Actuator, settings: WatchSettings, call: Call
) -> Judge:
    return Judge(
        history=history,
        actuator=actuator,
        settings=settings.alarm,
        diagnose=task.diagnose,
        cut=task.cut,
        detector=task.detector,
        takes_new_units=task.takes_new_units,
        seed=task.seed,
        watcher=task.watcher,
        call=call,
    )


def _source(
    task: WatchTask,
    actuator: Actuator,
    state: WatchState,
    settings: WatchSettings,
    call: Call,
    *,
    is_lost: bool,
) -> Source:
    if isinstance(task.source, int):
        return StreamSource(task.source, actuator, task.ownership, state, settings.stream, task.split, call)
    return FolderSource(
        folder=task.source,
        actuator=actuator,
        ownership=task.ownership,
        state=state,
        settings=settings.folder,
        split=task.split,
        call=call,
        is_lost=is_lost,
    )


@dataclass(eq=False)
class _Watcher:
    """The loop; its lasting state is in the history, so that it may be killed at any moment."""

    source: Source
    history: History
    judge: Judge
    outlook: Outlook
    pressure: Pressure
    deliveries: Sequence[Delivery]
    settings: WatchSettings
    stop: threading.Event
    say: Callable[[str], None]
    on_count: Callable[[int, int], None] | None
    done: Watching
    without_estimator: str = ""

    def run(self, *, once: bool, ends: Callable[[], bool]) -> None:
        """Run until `stop` is set or `ends` returns True, with `once` until the source is exhausted.

        `StoppedError` if `stop` was set during a step.
        """
        while not (self.stop.is_set() or ends()):
            if self._step():
                continue
            if once and self.source.exhausted and not self.outlook.waiting:
                self._keep(self.source.events())
                return
            self.stop.wait(IDLE_S)

    def _step(self) -> bool:
        """Judge the next arrival and continue with prognoses; return whether there was an arrival."""
        arrival = self._with_retries(self.source.next)
        self._keep([*self.source.events(), *self.pressure.events(self.source)])
        if arrival is not None:
            with self.pressure.measured():
                self._judge(arrival)
        if self.outlook.waiting and (arrival is None or self.outlook.is_isolated):
            self._update_prognoses()
        return arrival is not None

    def _update_prognoses(self) -> None:
        """Continue with the prognoses that are due."""
        try:
            if self._with_retries(self.outlook.step):
                self.done.prognoses += 1
                self._wake()
        except NoPrognosisError as error:
            self.say(str(error))
        except (HistoryFormError, StoppedError):
            raise
        except Exception as error:  # noqa: BLE001 - a defect must not end the monitoring of other units
            self.say("".join(traceback.format_exception(error)).strip())

    def _judge(self, arrival: Arrival) -> None:
        """Judge an arrival; if it kills its process, it is tried once more and then set aside."""
        before, outcome = self.done.judged + self.done.known, ""
        while not outcome:
            refused = list[str]()
            try:
                with self._refusing(arrival.name, refused):
                    for entry, recording in arrival.read():
                        self._judge_parts(arrival, entry, recording, refused)
            except EndedError as error:
                if self._with_retries(arrival.once_more):
                    self.say(f"{arrival.name}: {error}; it is tried once more")
                    continue
                refused.append(f"{arrival.name}: {error}, for the second time; {NOT_AGAIN}")
                outcome = SET_ASIDE
            any_judged = self.done.judged + self.done.known > before
            outcome = outcome or (JUDGED if not refused else PARTLY if any_judged else REFUSED)
        self.done.refused += len(refused)
        events = [self._refusal(arrival, reason) for reason in dict.fromkeys(refused)]
        if self._with_retries(lambda: arrival.finish(outcome, events)) < len(events):
            self.say(f"refused as before: {refused[0]}")  # its event was printed by an earlier run
        self._wake()
        if self.on_count:
            count = self.done.judged + self.done.known
            self.on_count(count, count + self.source.waiting)

    def _judge_parts(self, arrival: Arrival, entry: Entry, recording: Recording, refused: list[str]) -> None:
        """Judge the parts of a recording; the reasons of refused parts are added to `refused`."""
        with self._refusing(recording.source, refused):
            self._with_retries(partial(self.judge.check, entry))
            for part in self.judge.parts(recording):
                with self._refusing(part.source, refused):
                    self._judge_one(arrival, entry, part)

    @contextmanager
    def _refusing(self, name: str, refused: list[str]) -> Iterator[None]:
        """Add the error of the body to `refused`, so that other recordings are still judged."""
        try:
            yield
        except (HistoryFormError, StoppedError, EndedError):
            raise
        except EmaphmError as error:
            refused.append(str(error))
        except MemoryError:
            refused.append(f"{name}: {TOO_MUCH_MEMORY}")
        except Exception as error:  # noqa: BLE001 - a defect must not end the monitoring of other units
            self.say("".join(traceback.format_exception(error)).strip())
            refused.append(f"{name}: a defect of emaphm, please report it: {error!r}")

    def _judge_one(self, arrival: Arrival, entry: Entry, part: Recording) -> None:
        self._check_estimator()
        diagnosis = self._with_retries(lambda: self.judge.judged(entry, part))
        details = {"latency_s": round(time.monotonic() - arrival.arrived, 3)}
        self._with_retries(lambda: self.judge.filed(entry, part, diagnosis, details))
        self.done.known += diagnosis is None
        self.done.judged += diagnosis is not None
        self._wake()
        self.outlook.ask(entry.unit)

    def _check_estimator(self) -> None:
        """Report when the estimator can no longer be used, and when it can be used again."""
        reason = refusal_of(self.judge.diagnose, self.judge.actuator)
        if reason and not self.without_estimator:
            self.say(f"{reason}; meanwhile recordings are diagnosed by the full search")
        if self.without_estimator and not reason:
            self.say("the estimator can be used again")
        self.without_estimator = reason

    def _refusal(self, arrival: Arrival, reason: str) -> Event:
        """Return the event of a refusal; it is the same event for the same content and reason."""
        return Event(
            "refused",
            "raised",
            "warning",
            reason,
            arrival.name,
            details={"file_sha256": arrival.digest} if arrival.digest else {},
            watcher=self.judge.watcher,
        )

    def _keep(self, events: Sequence[Event]) -> None:
        if events:
            self._with_retries(lambda: self.history.add_events(*events))
            left_out = [
                count for event in events if event.kind == "rows_skipped" for count in event.details.values()
            ]
            self.done.rows_left_out += sum(left_out)
            self._wake()

    def _wake(self) -> None:
        for delivery in self.deliveries:
            delivery.wake()

    def _with_retries(self, action: Callable[[], T]) -> T:
        """Return the result of `action`, which is repeated while the history is not available."""
        pause, reported = self.settings.delivery.first_pause_s, ""
        while True:
            try:
                result = action()
            except HistoryUnavailableError as error:
                if str(error) != reported:
                    self.say(f"{error}; trying again, nothing is lost meanwhile")
                    reported = str(error)
                if self.stop.wait(pause):
                    raise StoppedError from None
                pause = min(2 * pause, self.settings.retry_s)
            else:
                if reported:
                    self.say("the history can be used again")
                return result
