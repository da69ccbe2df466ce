"""Replay of a recording: its command and load drive a model, which is compared with the other channels."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from emaphm.actuator import Actuator, Faults
from emaphm.actuator.argument import check_actuator
from emaphm.arrays import Array
from emaphm.estimation.posing import problem_of
from emaphm.estimation.replay.errors import ErrorStatistics, error_table, relative_of, warnings
from emaphm.recording import Recording, check_plausible, with_equivalent_current
from emaphm.recording.argument import check_recording
from emaphm.recording.schema import SCHEMA
from emaphm.simulation import model_named
from emaphm.version import VERSION

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Replay:
    """A recording, and the sensed `signals` of the model by channel, each (samples,).

    Rows before the `first_row` are not compared: they depend on an unknown motion before the recording.
    """

    recording: Recording
    actuator: Actuator
    model: str
    signals: Mapping[str, Array]
    first_row: int = 0

    @cached_property
    def errors(self) -> Mapping[str, ErrorStatistics]:
        """The errors of the channels that recording and model have in common."""
        return {
            name: ErrorStatistics.of(name, [self.compared(name)])
            for name in SCHEMA
            if name in self.recording and name in self.signals
        }

    def compared(self, name: str) -> tuple[Array, Array]:
        """Return the compared rows of a channel, measured and modelled, (rows,) each."""
        return self.recording[name][self.first_row :], self.signals[name][self.first_row :]

    @property
    def mean_absolute_error(self) -> Mapping[str, float]:
        """The mean of |measured - model| by channel, in its unit."""
        return {name: error.mean_absolute for name, error in self.errors.items()}

    @property
    def rms_error(self) -> Mapping[str, float]:
        """The rms of measured - model by channel, in its unit."""
        return {name: error.rms for name, error in self.errors.items()}

    @property
    def relative_error(self) -> Mapping[str, float]:
        """rms(measured - model) / rms(measured) by channel, as a fraction; without channels that are 0."""
        return relative_of(self.errors)

    @property
    def warnings(self) -> tuple[str, ...]:
        """A sentence on each channel with a relative error above 1."""
        return warnings(self.errors)

    def to_dict(self) -> dict[str, Any]:
        """Return the output of `emaphm replay --json`."""
        return {
            "relative_error": dict(self.relative_error),
            "mean_absolute_error": dict(self.mean_absolute_error),
            "rms_error": dict(self.rms_error),
            "warnings": list(self.warnings),
            "notes": list(self.recording.notes),
            "model": self.model,
            "recording": self.recording.source,
            "actuator": self.actuator.name,
            "version": VERSION,
        }

    def to_json(self) -> str:
        """Return the errors as JSON."""
        return json.dumps(self.to_dict(), indent=2)

    def plot(self) -> "Figure":
        """Draw each channel, measured against model, with its residual."""
        from emaphm.plotting.replay import draw_replay

        return draw_replay(self.recording, self.signals, self.actuator, self.relative_error)

    def __str__(self) -> str:
        """Return a table of the errors, with notes on the recording and warnings."""
        return "\n".join(
            [
                error_table(self.errors, self.actuator.coordinates),
                *(f"Note: {note}." for note in self.recording.notes),
                *(f"Warning: {warning}." for warning in self.warnings),
            ]
        )


def replay(
    recording: Recording, actuator: Actuator, *, faults: Faults | None = None, model: str = "averaged"
) -> Replay:
    """Return the replay of `recording` by `model` of `actuator`, healthy unless `faults` are given.

    Parameters
    ----------
    recording
        Its command and load (0 if not recorded) drive the model; the other channels are compared.
    actuator
        The description of the unit.
    faults
        The faults of the model.
    model
        "averaged", "monitor" or "reference".

    Raises
    ------
    FaultError
        The friction is less than the actuator can have (`emaphm.actuator.faults.lower_bounds`).
    RecordingError
        `recording` is no `Recording`, or its values differ from this actuator's by orders of magnitude.
    ActuatorError
        `actuator` is no `Actuator`.
    MethodError
        The model is unknown, or it has none of the recorded channels.
    """
    check_recording(recording)
    check_actuator(actuator)
    check_plausible(recording, actuator)
    recording = with_equivalent_current(recording, actuator)
    problem = problem_of(recording, actuator, model_named(model))
    signals = problem.signals((faults or Faults()).vector)
    if actuator.electrical is None:
        del signals["voltage_V"]  # an ideal current loop has no defined voltage
    recording = recording.with_channels(recording.channels, problem.unknown_start.notes())
    return Replay(recording, actuator, model, signals, problem.unknown_start.rows)
