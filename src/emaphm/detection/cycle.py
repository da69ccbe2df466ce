"""A recording as the detector sees it: one cycle of a manoeuvre, its channels less what a model explains."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.detection.row_offset import row_offset
from emaphm.errors import RecordingError
from emaphm.estimation.replay import replay
from emaphm.recording import Recording
from emaphm.recording.schema import PHASES, RESPONSES

COMPARED = (*RESPONSES, *PHASES)
"""Channels that a detector looks at, where all recordings have them."""


@dataclass(frozen=True, eq=False)
class Cycle:
    """One cycle.

    Attributes
    ----------
    signals
        (rows, channels), each in its channel's unit: measured, less the model's where one replays it.
    command, load
        At each row, (rows,); the load is 0 where none was recorded.
    interval_s
        Between rows [s].
    source
        Where it comes from, for messages.
    load_recorded
        Whether the load is a recorded one.
    """

    signals: Array
    command: Array
    load: Array
    interval_s: float
    source: str
    load_recorded: bool

    def along(self, command: Array, most_share: float) -> "Cycle":
        """Return the cycle at the rows of `command` (rows,), with its own command where that one is.

        Loggers do not begin every cycle at the same row: one that lacks its first is not taken for one that
        lags. In rows that it lacks, its signals are NaN, and its command and load those of the nearest row.

        Parameters
        ----------
        most_share
            By which share of the rows it may begin earlier or later.
        """
        most = max(1, int(most_share * command.size))
        rows = np.arange(command.size) - row_offset(self.command, command, most)
        keep = np.clip(rows, 0, self.command.size - 1)
        signals = np.where((rows == keep)[:, np.newaxis], self.signals[keep], np.nan)
        return replace(self, signals=signals, command=self.command[keep], load=self.load[keep])


def with_nearest(residuals: Array) -> Array:
    """Return residuals (rows, channels) whose rows of NaN, at the ends, are the nearest other row."""
    known = np.flatnonzero(~np.isnan(residuals[:, 0]))
    return residuals[np.clip(np.arange(len(residuals)), known[0], known[-1])]


def common_channels(recordings: Sequence[Recording]) -> tuple[str, ...]:
    """Return the channels that a detector learns from: those that all recordings have.

    Without those of `repeated_channels`: any deviation from what never varies would be infinite.

    Raises
    ------
    RecordingError
        They have none in common, or differ in none.
    """
    channels = shared_channels(recordings)
    if not channels:
        raise RecordingError(
            f"{recordings[0].source}: the {len(recordings)} recordings have no response in common "
            f"({', '.join(COMPARED[:1])}, position_rad, …); learn from recordings with the same channels"
        )
    repeated = repeated_channels(recordings)
    varying = tuple(name for name in channels if name not in repeated)
    if not varying:
        raise RecordingError(
            f"{recordings[0].source}: the {len(recordings)} recordings are the same, row by row; give "
            "independent runs, with the noise of their sensors"
        )
    return varying


def repeated_channels(recordings: Sequence[Recording]) -> tuple[str, ...]:
    """Return the shared channels that are the same, row by row, in all recordings of the same command.

    So they are in simulations with noise on other channels, and where a sensor is dead.
    """
    by_command: dict[bytes, list[Recording]] = {}
    for one in recordings:
        by_command.setdefault(one["command_rad"].tobytes(), []).append(one)
    pairs = [(alike[0], one) for alike in by_command.values() for one in alike[1:]]
    return tuple(
        name
        for name in shared_channels(recordings)
        if pairs and all(np.array_equal(one[name], other[name]) for one, other in pairs)
    )


def shared_channels(recordings: Sequence[Recording]) -> tuple[str, ...]:
    """Return the channels that all recordings have, of those that a detector looks at."""
    return tuple(name for name in COMPARED if all(name in one for one in recordings))


def cycle_of(recording: Recording, channels: Sequence[str], actuator: Actuator | None) -> Cycle:
    """Return the cycle in a recording.

    Parameters
    ----------
    recording
        Of one cycle.
    channels
        What is looked at, in this order.
    actuator
        Replays command and load, so that the residual to its model is looked at; None where the
        measured channels themselves are.

    Raises
    ------
    RecordingError
        A channel is missing; or the recording cannot be meant for the actuator.
    """
    missing = [name for name in channels if name not in recording]
    if missing:
        raise RecordingError(
            f"{recording.source}: no {', '.join(missing)}, which the detector was taught with; record it, "
            "or learn again without"
        )
    modelled = replay(recording, actuator).signals if actuator else {}
    signals = [recording[name] - modelled[name] if name in modelled else recording[name] for name in channels]
    load_recorded = "load_Nm" in recording
    return Cycle(
        np.stack(signals, axis=1),
        recording["command_rad"],
        recording["load_Nm"] if load_recorded else np.zeros(recording.samples),
        recording.interval_s,
        recording.source,
        load_recorded,
    )


def check_each_once(cycles: Sequence[Cycle]) -> None:
    """Refuse cycles that are the same, row by row: a cycle given twice would count as two.

    Raises
    ------
    RecordingError
        Two are the same.
    """
    first: dict[bytes, Cycle] = {}
    for cycle in cycles:
        content = hashlib.sha256()
        for values in (cycle.signals, cycle.command, cycle.load):
            content.update(np.ascontiguousarray(values).tobytes())
        same = first.setdefault(content.digest(), cycle)
        if same is not cycle:
            raise RecordingError(
                f"{cycle.source}: the same, row by row, as {same.source}; give each cycle once, or, if these "
                "are simulations, with the noise of their sensors"
            )
