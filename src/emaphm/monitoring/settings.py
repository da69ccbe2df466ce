"""How recordings are watched: times, sizes, and from when on something is an event."""

from dataclasses import dataclass


@dataclass(frozen=True)
class FolderSettings:
    """Of a folder that is watched.

    `poll_s`: between two looks at it [s]; a look takes at most `most_busy` of the time. `settle_s`: a file is
    whole when its size and time of change have stayed the same for so long [s]; loggers flush each second or
    more often. `most_waiting`: files that are remembered at once; more are found at a later look. `tries`:
    attempts to read a file that the system refuses, before it is called unreadable.
    """

    poll_s: float = 1.0
    settle_s: float = 2.0
    most_busy: float = 0.2
    most_waiting: int = 2000
    tries: int = 3


@dataclass(frozen=True)
class StreamSettings:
    """Of a stream of rows.

    A movement ends where the command has rested for `rest_s` [s], as in `experiment.segmentation`; a longer
    gap in the times begins a new one. `longest_s` [s] and `most_rows`: longest movement that is held; what
    follows it until the next rest is skipped. `reorder_rows`: rows that one may come late by; as many
    late ones in succession are a clock that was set back. `idle_s`: time without rows [s] after which what is
    there is judged, and a unit may give way to one that comes back. `queue`: movements that wait for the
    diagnosis, before the stream is held back. `most_units`: of which movements are held at once.
    `longest_line`: longer ones are no rows [bytes].
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
    """From when on a condition is an alarm, and from when on no longer.

    `raise_after`, `clear_after`: diagnoses in succession that must agree. `window`: diagnoses that are looked
    back at, and more where few of them decide. `false_verdicts`: share of healthy recordings of which a
    component is called degraded: 0 of 500 (`emaphm study run accuracy`, docs/accuracy.md), so 0.6 % at most
    with 95 % confidence (Clopper and Pearson).
    """

    raise_after: int = 3
    clear_after: int = 3
    window: int = 30
    false_verdicts: float = 0.006


@dataclass(frozen=True)
class PrognosisSettings:
    """Of the prognosis that is kept up to date, and of its event; `emaphm serve` has the same.

    `horizon` [h] and `risk`: `rul_below_horizon` is raised where the probability of failure within this
    horizon exceeds this risk; that of a healthy unit stays below. `clears_at`: share of the risk at which it
    is cleared. `fewest`: explained diagnoses before it is raised: with fewer, the prior decides. `most`:
    diagnoses of a unit that are used, and of each that it learns from: half of them the latest, the others
    evenly from the hours before; more take longer and change little.
    `python -m tests.monitoring.cost` measures these.
    """

    horizon: float = 200.0
    risk: float = 0.05
    clears_at: float = 0.5
    fewest: int = 5
    most: int = 100


@dataclass(frozen=True)
class DeliverySettings:
    """Of sending events.

    `timeout_s`: for an answer of a webhook [s]. `first_pause_s`, `longest_pause_s`: between attempts, doubled
    each time [s]. `tries`: of an event that the receiver refuses (status 3xx, 4xx), before the next is sent.
    `batch`: events read from the history at once. `last_s`: for what is left, at the end [s].
    """

    timeout_s: float = 5.0
    first_pause_s: float = 1.0
    longest_pause_s: float = 300.0
    tries: int = 5
    batch: int = 100
    last_s: float = 5.0


@dataclass(frozen=True)
class PressureSettings:
    """Back-pressure is raised where what waits takes `raise_s` to judge [s], cleared below `clear_s`."""

    raise_s: float = 60.0
    clear_s: float = 10.0


@dataclass(frozen=True)
class IsolationSettings:
    """Of the process that reads and diagnoses, and of the one that makes prognoses.

    `seconds`: that one recording may take [s]; the slowest diagnosis takes a tenth. `most_bytes`: address
    space [bytes]; libraries reserve more than they use. `last_s`: that a diagnosis has left when the watching
    is to stop [s]; most are done within it.
    """

    seconds: float = 600.0
    most_bytes: int = 8 * 2**30
    last_s: float = 2.0


@dataclass(frozen=True)
class WatchSettings:
    """Of watching, each part with settings of its own.

    `folder` and `stream`: how recordings arrive. `alarm`: from when on a condition is one. `prognosis`: what
    is kept up to date. `delivery`: sending events. `pressure`: from when on too much waits. `isolation`: the
    processes that read, diagnose and prognose. `retry_s`: longest pause between attempts to reach a history
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
