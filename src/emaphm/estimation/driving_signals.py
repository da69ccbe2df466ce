"""Input signals of a model: command, load and enable switch, of a recording or of a planned test."""

import threading
from dataclasses import dataclass
from typing import Self
from weakref import WeakKeyDictionary

import numpy as np

from emaphm.actuator import Actuator, Command, Load
from emaphm.actuator.channels import Sampling
from emaphm.actuator.commands import sample_held
from emaphm.recording import Recording, held, other_curve, reconstructed
from emaphm.simulation import Inputs

MOST_KEPT_STEPS = 128_000_000
"""Largest total number of steps, over all recordings, whose signals are kept for further runs of the same
models: 1 GB for each signal that changes from step to step."""


@dataclass(frozen=True, eq=False)
class DrivingSignals:
    """Input signals of a model as functions of time [s], and the rows in which its outputs are compared.

    `command` [rad] is at the user, `load` [N·m] at the motor; there are `samples` rows, `interval` [s] apart.
    `enabled` (0 where the drive is switched off, else 1) is None if it was not recorded. `other_command`,
    another curve through the rows of the command, is None if the rows are dense.
    """

    command: Command
    load: Load
    samples: int
    interval: float
    sampling: Sampling
    enabled: Command | None = None
    other_command: Command | None = None

    @classmethod
    def of(cls, recording: Recording, actuator: Actuator) -> Self:
        """Return recorded command and load as smooth curves, and the piecewise constant switch.

        The command is also piecewise constant if the `actuator`'s drive holds it.
        """
        sent, interval = actuator.channels.command_held, recording.interval_s
        if sent:
            command = sample_held(held(recording, "command_rad"), interval, sent)
        else:
            command = reconstructed(recording, "command_rad")
        return cls(
            command,
            reconstructed(recording, "load_Nm") if "load_Nm" in recording else 0.0,
            recording.samples,
            interval,
            recording.sampling,
            held(recording, "enabled") if "enabled" in recording else None,
            None if sent else other_curve(recording, "command_rad"),
        )

    def beginning(self, seconds: float, samples: int) -> "DrivingSignals":
        """Return the signals of `samples` rows that begin `seconds` after the beginning of these signals.

        With negative `seconds`, each signal keeps its first value before the beginning.
        """

        def shifted(signal: Command) -> Command:
            return lambda times: signal(np.maximum(times + seconds, 0.0))

        return DrivingSignals(
            shifted(self.command),
            shifted(self.load) if callable(self.load) else self.load,
            samples,
            self.interval,
            self.sampling,
            enabled=shifted(self.enabled) if self.enabled is not None else None,
        )

    def inputs(self, step: float) -> Inputs:
        """Return the signals at every step of a model, with steps of at most `step` [s]."""
        cached = _CACHE.get(self, {})
        if step in cached:
            return cached[step]
        inputs = Inputs.of(
            self.command,
            self.load,
            samples=self.samples,
            interval=self.interval,
            step=step,
            sampling=self.sampling,
            enabled=self.enabled,
        )
        _store(self, step, inputs)
        return inputs


_CACHE: WeakKeyDictionary[DrivingSignals, dict[float, Inputs]] = WeakKeyDictionary()
"""Signals at the steps of the models, by step length, of all recordings in use."""

_CACHE_LOCK = threading.Lock()


def _store(signals: DrivingSignals, step: float, inputs: Inputs) -> None:
    """Store `inputs` for the next run; above `MOST_KEPT_STEPS`, the oldest recording's inputs are dropped."""
    if inputs.command.size > MOST_KEPT_STEPS:
        return
    with _CACHE_LOCK:
        _CACHE.setdefault(signals, {})[step] = inputs
        while (
            sum(kept.command.size for by_step in _CACHE.values() for kept in by_step.values())
            > MOST_KEPT_STEPS
        ):
            del _CACHE[next(iter(_CACHE))]
