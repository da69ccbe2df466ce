"""What drives a model: command, load, supply and switch, from a recording or from a planned test."""

import threading
from dataclasses import dataclass
from typing import Self
from weakref import WeakKeyDictionary

import numpy as np

from emaphm.actuator import Command, Load
from emaphm.actuator.channels import Sampling
from emaphm.recording import Recording, held, other_curve, reconstructed
from emaphm.simulation import Inputs

MOST_KEPT_STEPS = 128_000_000
"""Steps up to which signals are kept for the next runs of the same models, of all recordings together: 1 GB
of each signal that changes from step to step."""


@dataclass(frozen=True, eq=False)
class DrivingSignals:
    """What drives a model as functions of time [s], and the rows that the outputs are compared in.

    `command` [rad] at the user, `load` [N·m] at the motor; `samples` rows, `interval` [s] apart. `supply` [V]
    and `enabled` (0 where the drive is switched off, else 1) are None where they were not recorded, and
    `other_command`, which has the same rows as the command, where these are dense.
    """

    command: Command
    load: Load
    samples: int
    interval: float
    sampling: Sampling
    supply: Command | None = None
    enabled: Command | None = None
    other_command: Command | None = None

    @classmethod
    def of(cls, recording: Recording) -> Self:
        """Return the recorded command, load and supply as smooth curves behind the rows, the switch held."""
        return cls(
            reconstructed(recording, "command_rad"),
            reconstructed(recording, "load_Nm") if "load_Nm" in recording else 0.0,
            recording.samples,
            recording.interval_s,
            recording.sampling,
            reconstructed(recording, "supply_V") if "supply_V" in recording else None,
            held(recording, "enabled") if "enabled" in recording else None,
            other_curve(recording, "command_rad"),
        )

    def beginning(self, seconds: float, samples: int) -> "DrivingSignals":
        """Return the `samples` rows that begin `seconds` into these signals.

        Before their own beginning, where `seconds` is below 0, each holds its first value.
        """

        def later(signal: Command) -> Command:
            return lambda times: signal(np.maximum(times + seconds, 0.0))

        return DrivingSignals(
            later(self.command),
            later(self.load) if callable(self.load) else self.load,
            samples,
            self.interval,
            self.sampling,
            enabled=later(self.enabled) if self.enabled is not None else None,
        )

    def inputs(self, step: float) -> Inputs:
        """Return the signals at every step of a model, `step` [s] long at most."""
        kept = _KEPT.get(self, {})
        if step in kept:
            return kept[step]
        inputs = Inputs.of(
            self.command,
            self.load,
            samples=self.samples,
            interval=self.interval,
            step=step,
            sampling=self.sampling,
            enabled=self.enabled,
        )
        _keep(self, step, inputs)
        return inputs


_KEPT: WeakKeyDictionary[DrivingSignals, dict[float, Inputs]] = WeakKeyDictionary()
"""Signals at the steps of models that have run, by step, of all recordings in use."""

_KEEPING = threading.Lock()


def _keep(signals: DrivingSignals, step: float, inputs: Inputs) -> None:
    """Keep `inputs` for the next run, within bounds: those of the recordings first kept go first."""
    if inputs.command.size > MOST_KEPT_STEPS:
        return
    with _KEEPING:
        _KEPT.setdefault(signals, {})[step] = inputs
        while sum(one.command.size for kept in _KEPT.values() for one in kept.values()) > MOST_KEPT_STEPS:
            del _KEPT[next(iter(_KEPT))]
