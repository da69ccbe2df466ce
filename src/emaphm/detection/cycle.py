"""One cycle of a manoeuvre for the detector: its channels, less the output of a model where there is one."""

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
"""Channels that a detector evaluates if all recordings have them."""


@dataclass(frozen=True, eq=False)
class Cycle:
    """One cycle of a manoeuvre.

    Attributes
    ----------
    signals
        Channels (rows, channels), each in its unit: as measured, less the model's output where there is one.
    command, load
        Command and load (rows,); the load is 0 if none was recorded.
    interval_s
        Sampling interval [s].
    source
        Name of the recording, for messages.
    load_recorded
        Whether the load was recorded.
    """

    signals: Array
    command: Array
    load: Array
    interval_s: float
    source: str
    load_recorded: bool

    def aligned_to(self, command: Array, most_share: float) -> "Cycle":
        """Return the cycle shifted by rows so that its command fits `command` (rows,) best, at its rows.

        Loggers do not begin each cycle at the same row. Without the shift, a cycle that lacks its first row
        would look like one with a delay. In missing rows the signals are NaN, and command and load are those
        of the nearest row.

        Parameters
        ----------
        most_share
            Largest shift in either direction, as a share of the rows.
        """
        most = max(1, int(most_share * command.size))
        rows = np.arange(command.size) - row_offset(self.command, command, most)
        nearest = np.clip(rows, 0, self.command.size - 1)
        signals = np.where((rows == nearest)[:, np.newaxis], self.signals[nearest], np.nan)
        return replace(self, signals=signals, command=self.command[nearest], load=self.load[nearest])


def with_nearest(residuals: Array) -> Array:
    """Return residuals (rows, channels) with missing rows (NaN) at the ends replaced by the nearest row."""
    known = np.flatnonzero(~np.isnan(residuals[:, 0]))
    return residuals[np.clip(np.arange(len(residuals)), known[0], known[-1])]


def common_channels(recordings: Sequence[Recording]) -> tuple[str, ...]:
    """Return the channels that a detector learns from: `shared_channels` without `repeated_channels`.

    A channel that does not vary between healthy recordings has no scatter, so that any deviation of it would
    be infinite.

    Raises
    ------
    RecordingError
        The recordings have no channel in common, or do not differ in any.
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

    They occur in simulations with noise on other channels only, and if a sensor is dead.
    """
    by_command: dict[bytes, list[Recording]] = {}
    for recording in recordings:
        by_command.setdefault(recording["command_rad"].tobytes(), []).append(recording)
    pairs = [(group[0], recording) for group in by_command.values() for recording in group[1:]]
    return tuple(
        name
        for name in shared_channels(recordings)
        if pairs and all(np.array_equal(first[name], second[name]) for first, second in pairs)
    )


def shared_channels(recordings: Sequence[Recording]) -> tuple[str, ...]:
    """Return those of the `COMPARED` channels that all recordings have."""
    return tuple(name for name in COMPARED if all(name in recording for recording in recordings))


def cycle_of(recording: Recording, channels: Sequence[str], actuator: Actuator | None) -> Cycle:
    """Return the cycle in a recording.

    Parameters
    ----------
    recording
        A recording of one cycle.
    channels
        The channels to evaluate, in this order.
    actuator
        The description whose model replays command and load, so that its residual is evaluated; None if the
        measured channels are evaluated.

    Raises
    ------
    RecordingError
        A channel is missing, or the recording cannot be of this actuator.
    """
    missing = [name for name in channels if name not in recording]
    if missing:
        raise RecordingError(
            f"{recording.source}: no {', '.join(missing)}, which the detector has learned with; record it, "
            "or learn again without it"
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
    """Raise an error for cycles that are the same, row by row: a repeated cycle would count as two.

    Raises
    ------
    RecordingError
        Two cycles are the same.
    """
    first: dict[bytes, Cycle] = {}
    for cycle in cycles:
        content = hashlib.sha256()
        for values in (cycle.signals, cycle.command, cycle.load):
            content.update(np.ascontiguousarray(values).tobytes())
        earlier = first.setdefault(content.digest(), cycle)
        if earlier is not cycle:
            raise RecordingError(
                f"{cycle.source}: the same, row by row, as {earlier.source}; give each cycle once, or, if "
                "these are simulations, with the noise of their sensors"
            )
