"""Settings of online monitoring: times, sizes, and thresholds of events."""

from dataclasses import dataclass


@dataclass(frozen=True)
class FolderSettings:
    """Settings of a watched folder.

    `poll_s`: time between two polls [s]; polling takes at most the share `most_busy` of the time. `settle_s`:
    time without change of a file's size and modification time after which it is complete [s]; loggers flush
    at least each second. `most_waiting`: number of files that are noted at once; further files are found at a
    later poll. `tries`: attempts to read a file that the system refuses, before it is reported as unreadable.
    """

    poll_s: float = 1.0
    settle_s: float = 2.0
    most_busy: float = 0.2
    most_waiting: int = 2000
    tries: int = 3


@dataclass(frozen=True)
class StreamSettings:
    """Settings of a stream of rows.

    A movement ends when the command has rested for `rest_s` [s], as in `experiment.segmentation`; a longer
    gap in the times begins a new movement. `longest_s` [s] and `most_rows`: longest movement in memory; the
    rows after it, until the next rest, are skipped. `reorder_rows`: largest number of rows by which a row may
    be late; more late rows in succession mean a clock that was set back. `idle_s`: time without rows [s]
    after which the rows in memory are judged, and a unit may be replaced by a returning unit. `queue`: number
    of movements that wait for the diagnosis before the stream is held back. `most_units`: number of units
    with movements in memory. `longest_line`: longest line that is accepted as a row [bytes].
    """

    rest_s: float = 1.0
    longest_s: float = 60.0
    most_rows: int = 200_000
    reorder_rows: int = 32
    idle_s: float = 5.0
    queue: int = 4
    most_units: int = 16
    longest_line: int = 65_536


@dataclass(frozen=True)
class AlarmSettings:
    """Thresholds from which a condition is raised as an alarm, and cleared.

    `raise_after`, `clear_after`: number of successive diagnoses that must agree. `window`: number of latest
    diagnoses that are read, more if few of them are decided. `false_verdicts`: share of healthy recordings
    with a component diagnosed as degraded: 0 of 500 (`emaphm study run accuracy`, docs/accuracy.md),
    therefore at most 0.6 % with 95 % confidence (Clopper and Pearson).
    """

    raise_after: int = 3
    clear_after: int = 3
    window: int = 30
    false_verdicts: float = 0.006


@dataclass(frozen=True)
class PrognosisSettings:
    """Settings of the updated prognosis and its event; `emaphm serve` has the same.

    `horizon` [h] and `risk`: `rul_below_horizon` is raised if the probability of failure within this horizon
    exceeds this risk; that of a healthy unit stays below. `clears_at`: share of the risk at which it is
    cleared. `fewest`: least number of explained diagnoses for the event; with fewer, the prior dominates.
    `most`: number of diagnoses that are used of the unit, and of each unit for the prior: half of them the
    latest, the others evenly from the hours before; more diagnoses take longer and change little. `python -m
    tests.monitoring.cost` measures these.
    """

    horizon: float = 200.0
    risk: float = 0.05
    clears_at: float = 0.5
    fewest: int = 5
    most: int = 100


@dataclass(frozen=True)
class DeliverySettings:
    """Settings of the delivery of events.

    `timeout_s`: longest time for an answer of a webhook [s]. `first_pause_s`, `longest_pause_s`: time between
    attempts, doubled each time [s]. `tries`: attempts with an event that the receiver refuses (status 3xx,
    4xx), before the next event is sent. `batch`: number of events that are read from the history at once.
    `last_s`: time for the remaining events at the end [s].
    """

    timeout_s: float = 5.0
    first_pause_s: float = 1.0
    longest_pause_s: float = 300.0
    tries: int = 5
    batch: int = 100
    last_s: float = 5.0


@dataclass(frozen=True)
class PressureSettings:
    """Waiting times of recordings at which back-pressure is raised, `raise_s`, and cleared, `clear_s` [s]."""

    raise_s: float = 60.0
    clear_s: float = 10.0


@dataclass(frozen=True)
class IsolationSettings:
    """Limits of the process that reads and diagnoses, and of the process for prognoses.

    `seconds`: longest time of a recording [s]; the slowest diagnosis takes a tenth. `most_bytes`: address
    space [bytes]; libraries reserve more than they use. `last_s`: time for the running diagnosis when the
    monitoring is stopped [s]; most diagnoses end within it.
    """

    seconds: float = 600.0
    most_bytes: int = 8 * 2**30
    last_s: float = 2.0


@dataclass(frozen=True)
class WatchSettings:
    """Settings of online monitoring.

    `folder` and `stream`: the sources. `alarm`: thresholds of alarms. `prognosis`: the updated prognoses.
    `delivery`: sending events. `pressure`: thresholds of back-pressure. `isolation`: limits of the processes
    that read, diagnose and compute prognoses. `retry_s`: longest pause between attempts to reach a history
    that fails [s].
    """

    folder: FolderSettings = FolderSettings()
    stream: StreamSettings = StreamSettings()
    alarm: AlarmSettings = AlarmSettings()
    prognosis: PrognosisSettings = PrognosisSettings()
    delivery: DeliverySettings = DeliverySettings()
    pressure: PressureSettings = PressureSettings()
    isolation: IsolationSettings = IsolationSettings()
    retry_s: float = 30.0


WATCH = WatchSettings()
