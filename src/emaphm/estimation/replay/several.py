"""Replay of several recordings by one model, with their single and combined errors."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from emaphm.actuator import Actuator, Faults
from emaphm.errors import MethodError
from emaphm.estimation.replay.errors import ErrorStatistics, error_table, relative_of
from emaphm.estimation.replay.single import Replay, replay
from emaphm.recording import Recording
from emaphm.recording.schema import SCHEMA
from emaphm.version import VERSION

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Replays:
    """Replays of one or more recordings by the same model of the same actuator."""

    replays: tuple[Replay, ...]

    @cached_property
    def errors(self) -> Mapping[str, ErrorStatistics]:
        """The errors of each channel over all rows of all recordings with this channel."""
        with_channel = {name: [each for each in self.replays if name in each.errors] for name in SCHEMA}
        return {
            name: ErrorStatistics.of(name, [each.compared(name) for each in replays])
            for name, replays in with_channel.items()
            if replays
        }

    @property
    def warnings(self) -> tuple[str, ...]:
        """The warnings of each recording, with its name."""
        return tuple(
            f"{each.recording.source}: {warning}" for each in self.replays for warning in each.warnings
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the output of `emaphm replay --json`: errors of each recording, and of all if several."""
        first, *further = self.replays
        if not further:
            return first.to_dict()
        return {
            "recordings": [each.to_dict() for each in self.replays],
            "relative_error": relative_of(self.errors),
            "mean_absolute_error": {name: error.mean_absolute for name, error in self.errors.items()},
            "rms_error": {name: error.rms for name, error in self.errors.items()},
            "warnings": list(self.warnings),
            "model": first.model,
            "actuator": first.actuator.name,
            "version": VERSION,
        }

    def to_json(self) -> str:
        """Return the errors as JSON."""
        return json.dumps(self.to_dict(), indent=2)

    def plot(self) -> "Figure":
        """Draw the recording with the largest relative error of a channel."""
        return max(self.replays, key=lambda each: max(each.relative_error.values(), default=0.0)).plot()

    def __str__(self) -> str:
        """Return a table of the errors for each recording, and for all rows together."""
        if len(self.replays) == 1:
            return str(self.replays[0])
        single = [f"{each.recording.source}\n{each}" for each in self.replays]
        table = error_table(self.errors, self.replays[0].actuator.coordinates)
        return "\n\n".join([*single, f"All {len(self.replays)} recordings\n{table}"])


def replay_all(
    recordings: Sequence[Recording],
    actuator: Actuator,
    *,
    faults: Faults | None = None,
    model: str = "averaged",
) -> Replays:
    """Return the replays of `recordings` by one model of one unit, each as by `emaphm.replay`.

    Parameters
    ----------
    recordings
        One or more; their channels may differ.
    actuator, faults, model
        As in `emaphm.replay`: "averaged", "monitor" or "reference".

    Raises
    ------
    MethodError
        There is no recording, the model is unknown, or it has none of the channels of a recording.
    FaultError, RecordingError
        As `emaphm.replay`.
    """
    if not recordings:
        raise MethodError("no recording to replay; give one or several")
    return Replays(tuple(replay(recording, actuator, faults=faults, model=model) for recording in recordings))
