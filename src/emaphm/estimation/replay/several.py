"""Several recordings replayed by one model, and judged one by one and together."""

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
        """The errors of each channel over all rows of all recordings that have it."""
        return {
            name: ErrorStatistics.of(name, [one.compared(name) for one in self.replays if name in one.errors])
            for name in SCHEMA
            if any(name in one.errors for one in self.replays)
        }

    @property
    def warnings(self) -> tuple[str, ...]:
        """The warnings of each recording, with its name."""
        return tuple(f"{one.recording.source}: {warning}" for one in self.replays for warning in one.warnings)

    def to_dict(self) -> dict[str, Any]:
        """Return what `emaphm replay --json` prints: of one recording as it is, of several with their sum."""
        first, *others = self.replays
        if not others:
            return first.to_dict()
        return {
            "recordings": [one.to_dict() for one in self.replays],
            "relative_error": relative_of(self.errors),
            "mean_absolute_error": {name: one.mean_absolute for name, one in self.errors.items()},
            "rms_error": {name: one.rms for name, one in self.errors.items()},
            "warnings": list(self.warnings),
            "model": first.model,
            "actuator": first.actuator.name,
            "version": VERSION,
        }

    def to_json(self) -> str:
        """Return the errors as JSON."""
        return json.dumps(self.to_dict(), indent=2)

    def plot(self) -> "Figure":
        """Draw the recording that the model is farthest from, by the largest relative error of a channel."""
        return max(self.replays, key=lambda one: max(one.relative_error.values(), default=0.0)).plot()

    def __str__(self) -> str:
        """Return a table of the errors for each recording, and for all rows together."""
        if len(self.replays) == 1:
            return str(self.replays[0])
        single = [f"{one.recording.source}\n{one}" for one in self.replays]
        table = error_table(self.errors, self.replays[0].actuator.coordinates)
        return "\n\n".join([*single, f"All {len(self.replays)} recordings\n{table}"])


def replay_all(
    recordings: Sequence[Recording],
    actuator: Actuator,
    *,
    faults: Faults | None = None,
    model: str = "averaged",
) -> Replays:
    """Return each of `recordings` replayed, as `emaphm.replay` does it, by one model of one unit.

    Parameters
    ----------
    recordings
        One or more; their channels may differ.
    actuator, faults, model
        As in `emaphm.replay`: "averaged", "monitor" or "reference".

    Raises
    ------
    MethodError
        There is no recording, the model is unknown, or has none of the channels of one.
    FaultError, RecordingError
        As `emaphm.replay`.
    """
    if not recordings:
        raise MethodError("no recording to replay; give one or several")
    return Replays(tuple(replay(one, actuator, faults=faults, model=model) for one in recordings))
