"""Replaying a recording: the model follows its command and load, and is compared with the other channels."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from emaphm.actuator import Actuator, Faults
from emaphm.arrays import Array
from emaphm.estimation.problem import Problem, rms
from emaphm.recording import Recording, check_plausible, with_equivalent_current
from emaphm.recording.schema import SCHEMA
from emaphm.simulation import model_named
from emaphm.simulation.laws.angles import wrap
from emaphm.text_table import format_table
from emaphm.version import VERSION

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Replay:
    """A recording, the model's `signals` for it, each (samples,), and the relative error of each channel.

    `relative_error` is rms(measured - model) / rms(measured), as a fraction.
    """

    recording: Recording
    actuator: Actuator
    model: str
    signals: Mapping[str, Array]
    relative_error: Mapping[str, float]

    def to_dict(self) -> dict[str, Any]:
        """Return what `emaphm replay --json` prints."""
        return {
            "relative_error": dict(self.relative_error),
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
        """Return a table of the relative errors."""
        rows = [(name, f"{100 * error:.4g} %") for name, error in self.relative_error.items()]
        return format_table(("channel", "relative error"), rows)


def replay(
    recording: Recording, actuator: Actuator, *, faults: Faults | None = None, model: str = "averaged"
) -> Replay:
    """Return `recording` replayed by `model` of `actuator`, healthy unless `faults` are given.

    Raises
    ------
    RecordingError
        The recording cannot be meant for this actuator, by orders of magnitude.
    MethodError
        The model is unknown.
    """
    check_plausible(recording, actuator)
    recording = with_equivalent_current(recording, actuator)
    problem = Problem.of(recording, actuator, model_named(model))
    signals = problem.signals((faults or Faults()).vector)
    if actuator.electrical is None:
        del signals["voltage_V"]  # an ideal current loop has no voltage to speak of
    shared = [name for name in SCHEMA if name in recording and name in signals]
    # A channel that is 0 throughout has nothing for an error to be relative to.
    errors = {
        name: relative_error(name, recording[name], signals[name])
        for name in shared
        if np.any(recording[name])
    }
    return Replay(recording, actuator, model, signals, errors)


def relative_error(name: str, measured: Array, modelled: Array) -> float:
    """Return rms(measured - model) / rms(measured) of a channel; angles are compared modulo a turn."""
    difference = measured - modelled
    if name == "angle_rad":
        difference = wrap(difference)
    return rms(difference) / rms(measured)
