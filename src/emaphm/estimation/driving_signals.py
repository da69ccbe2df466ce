"""What drives a model: the command and the load, from a recording or from a planned test."""

from dataclasses import dataclass
from typing import Self

from emaphm.actuator import Command, Load
from emaphm.recording import Recording, reconstructed
from emaphm.simulation import Inputs
from emaphm.simulation.engine.inputs import Sampling


@dataclass(frozen=True, eq=False)
class DrivingSignals:
    """Command and load as functions of time, and the rows that the outputs are compared in.

    `command` [rad] at the user, `load` [N·m] at the motor; `samples` rows, `interval` [s] apart.
    """

    command: Command
    load: Load
    samples: int
    interval: float
    sampling: Sampling

    @classmethod
    def of(cls, recording: Recording) -> Self:
        """Return the recorded command, and the load if recorded, as smooth curves behind the rows."""
        return cls(
            reconstructed(recording, "command_rad"),
            reconstructed(recording, "load_Nm") if "load_Nm" in recording else 0.0,
            recording.samples,
            recording.interval_s,
            recording.sampling,
        )

    def inputs(self, step: float) -> Inputs:
        """Return the signals at every step of a model, `step` [s] long at most."""
        return Inputs.of(
            self.command,
            self.load,
            samples=self.samples,
            interval=self.interval,
            step=step,
            sampling=self.sampling,
        )
