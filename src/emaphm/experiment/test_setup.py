"""The conditions of a test that is planned: what is recorded, how well, and what may be the matter."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from emaphm.actuator import NAMES, Actuator
from emaphm.actuator.faults import HEALTHY
from emaphm.arrays import Array
from emaphm.errors import MethodError, SignalError, nearest
from emaphm.estimation.methods import method_named
from emaphm.estimation.objective import LEAST_MOTION, Fit
from emaphm.estimation.search import fit_of
from emaphm.experiment.excitation import Manoeuvre
from emaphm.optimizers.space_filling import space_filling
from emaphm.recording import Recording, acquire, full_scales
from emaphm.simulation import AVERAGED, OBSERVABLE, REFERENCE, Initial, Inputs, Model, Plant, observe_batch

CHANNELS = {
    "current": "current_A",
    "voltage": "voltage_V",
    "position": "position_rad",
    "speed": "speed_rad_s",
}
"""What may be recorded, by the name that a user gives it."""

CONVERTER_BITS = 12
"""Resolution taken for the channels other than the current."""

LARGEST_SHORT = 0.7
"""Up to here the averaged model is meant for shorts (PHYSICS.md section 5)."""

FEWEST_ROWS = 50
"""Rows of the shortest manoeuvre: fewer tell next to nothing of ten unknowns."""


@dataclass(frozen=True, eq=False)
class Conditions:
    """Under which a test is made: `channels` by schema name, current first; `noise` of it [A rms]."""

    actuator: Actuator
    channels: tuple[str, ...]
    noise: float
    sample_rate: float
    workers: int | None = None

    @classmethod
    def of(
        cls,
        actuator: Actuator,
        channels: Sequence[str],
        noise: float,
        sample_rate: float,
        workers: int | None = None,
    ) -> Self:
        """Return the conditions, `channels` being names of `CHANNELS`.

        Raises
        ------
        MethodError, SignalError
            A channel is unknown, impossible for the actuator, or the current missing; the noise or rate
            is no positive number.
        """
        for name in channels:
            if name not in CHANNELS:
                raise MethodError(f"unknown channel '{name}'{nearest(name, CHANNELS)}")
        if "current" not in channels:
            raise MethodError("the current is what faults are told from; put current among the channels")
        if "voltage" in channels and actuator.electrical is None:
            raise MethodError(
                f"channel 'voltage' needs an [electrical] section, which actuator '{actuator.name}' lacks"
            )
        if not 0 < noise < np.inf:
            raise SignalError(f"noise of {noise:g} A is no sensor's rms; give more than 0")
        if not 0 < sample_rate < np.inf:
            raise SignalError(f"sample rate of {sample_rate:g} Hz is impossible; give more than 0")
        kept = tuple(column for name, column in CHANNELS.items() if name in channels)
        return cls(actuator, kept, noise, sample_rate, workers)

    @property
    def truth(self) -> Model:
        """The model that stands for the actuator: the reference model where the windings are described."""
        return AVERAGED if self.actuator.electrical is None else REFERENCE

    def fit(self, manoeuvre: Manoeuvre) -> Fit:
        """Return what a diagnosis would fit to a recording of `manoeuvre`, each channel at its noise.

        Raises
        ------
        SignalError
            The manoeuvre is too short, or does not move the actuator.
        """
        healthy = self._exact(manoeuvre, HEALTHY.vector[np.newaxis], AVERAGED)[0]
        if np.ptp(healthy["position_rad"]) <= LEAST_MOTION * np.ptp(healthy["command_rad"]):
            raise SignalError("the manoeuvre does not move the actuator; give it more amplitude or time")
        shown = self._shown(healthy)
        fit = fit_of(shown, self.actuator, method_named("hybrid"), AVERAGED, None, self.workers)
        problem = replace(fit.problem, start=Initial()).weighted(self._noises(shown))
        return replace(fit, problem=problem).against(self.noise)

    def record(self, manoeuvre: Manoeuvre, faults: Array, seed: int) -> list[Recording]:
        """Return what would be recorded of `manoeuvre` under `faults` (n, 8), as `truth` has it.

        The current with its noise, the other channels as a converter rounds them. The same row of the same
        fault vector has the same noise under every manoeuvre.
        """
        recordings = []
        for i, exact in enumerate(self._exact(manoeuvre, faults, self.truth)):
            shown = self._shown(exact)
            others = self._full_scales(shown)
            recordings.append(
                acquire(
                    shown,
                    noise={"current_A": self.noise},
                    adc_bits=CONVERTER_BITS if others else None,
                    full_scale=others,
                    seed=seed + i,
                )
            )
        return recordings

    def faults(self, count: int, seed: int) -> Array:
        """Return representative fault vectors (count, 8): the healthy one, and others that fill the space."""
        upper = np.ones(len(NAMES))
        upper[2:5] = LARGEST_SHORT
        if count == 1:
            return HEALTHY.vector[np.newaxis]
        others = space_filling(count - 1, np.zeros(len(NAMES)), upper, seed)
        return np.concatenate([HEALTHY.vector[np.newaxis], others])

    def _exact(self, manoeuvre: Manoeuvre, faults: Array, model: Model) -> list[Recording]:
        """Return noise-free recordings of every observable channel."""
        samples = round(manoeuvre.duration * self.sample_rate)
        if samples < FEWEST_ROWS:
            raise SignalError(
                f"{manoeuvre.duration:g} s at {self.sample_rate:g} Hz are {samples} rows; give time or rate "
                f"for {FEWEST_ROWS} or more"
            )
        inputs = Inputs.of(
            manoeuvre.command,
            samples=samples,
            interval=1 / self.sample_rate,
            step=model.step,
            sampling=self.actuator.channels.sampling,
        )
        known = {"time_s": inputs.time_s, "command_rad": inputs.rows(inputs.command)}
        plant = Plant.of(self.actuator, faults)
        signals = observe_batch(model, plant, inputs, workers=self.workers)
        return [
            Recording(known | dict(zip(OBSERVABLE, one, strict=True)), inputs.sampling, "simulated")
            for one in signals
        ]

    def _shown(self, recording: Recording) -> Recording:
        """Return `recording` with the channels that are recorded."""
        kept = {name: recording[name] for name in ("time_s", "command_rad", *self.channels)}
        return Recording(kept, recording.sampling, recording.source)

    def _noises(self, recording: Recording) -> Array:
        """Return the rms of each channel's noise (channels,): a converter's rounding but for the current."""
        steps = [2 * scale / 2**CONVERTER_BITS for scale in self._full_scales(recording).values()]
        return np.array([self.noise, *(step / 12**0.5 for step in steps)])

    def _full_scales(self, recording: Recording) -> dict[str, float]:
        """Return half the range of each channel's converter but for the current's.

        Where the description does not tell the range of a channel, twice its peak.
        """
        described = full_scales(self.actuator)
        return {
            name: described.get(name, 2 * float(np.max(np.abs(recording[name]))))
            for name in self.channels[1:]
        }
