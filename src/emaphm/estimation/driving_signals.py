"""What drives a model: command, load, supply and switch, from a recording or from a planned test."""

import threading
import weakref
from collections import deque
from dataclasses import dataclass, field
from typing import Self

from emaphm.actuator import Command, Load
from emaphm.recording import Recording, held, other_curve, reconstructed
from emaphm.simulation import Inputs
from emaphm.simulation.engine.inputs import Sampling

MOST_KEPT_STEPS = 128_000_000
"""Steps up to which signals are kept for the next runs of the same models, of all recordings together: 1 GB
of each signal that changes from step to step."""


@dataclass(frozen=True, eq=False)
class DrivingSignals:
    """What drives a model as functions of time [s], and the rows that the outputs are compared in.

    `command` [rad] at the user, `load` [N·m] at the motor; `samples` rows, `interval` [s] apart. `supply` [V]
    and `enabled` (0 where the drive is switched off, else 1) are None where they were not recorded, and
    `other_command`, which has the same rows as the command, where these are dense. `known` are the signals at
    the steps of models that have run, by step.
    """

    command: Command
    load: Load
    samples: int
    interval: float
    sampling: Sampling
    supply: Command | None = None
    enabled: Command | None = None
    other_command: Command | None = None
    known: dict[float, Inputs] = field(default_factory=dict, init=False, repr=False)

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

    def inputs(self, step: float) -> Inputs:
        """Return the signals at every step of a model, `step` [s] long at most."""
        kept = self.known.get(step)
        if kept is not None:
            return kept
        inputs = Inputs.of(
            self.command,
            self.load,
            samples=self.samples,
            interval=self.interval,
            step=step,
            sampling=self.sampling,
            enabled=self.enabled,
        )
        _KEPT.keep(self, step, inputs)
        return inputs


class _Kept:
    """Which signals are known of all that are in use, the ones first kept the first to go."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._known: deque[tuple[weakref.ref[DrivingSignals], float, int]] = deque()

    def keep(self, signals: DrivingSignals, step: float, inputs: Inputs) -> None:
        """Let `signals` know its `inputs` at a step, and others no longer, so that all stay within bounds."""
        steps = inputs.samples * inputs.substeps
        if steps > MOST_KEPT_STEPS:
            return
        with self._lock:
            in_use = [one for one in self._known if one[0]() is not None]
            self._known = deque([*in_use, (weakref.ref(signals), step, steps)])
            signals.known[step] = inputs
            total = sum(one[2] for one in self._known)
            while total > MOST_KEPT_STEPS:
                other, at, freed = self._known.popleft()
                total -= freed
                owner = other()
                if owner is not None:
                    owner.known.pop(at, None)


_KEPT = _Kept()
