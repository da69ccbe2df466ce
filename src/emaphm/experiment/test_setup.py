"""The set-up of a planned test: recorded channels, their noise, and representative faults."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from emaphm.actuator import NAMES, Actuator
from emaphm.actuator.commands import sample_held
from emaphm.actuator.faults import HEALTHY
from emaphm.arrays import Array
from emaphm.diagnosis.explanation.motion import LEAST_MOTION
from emaphm.errors import MethodError, SignalError, nearest
from emaphm.estimation.driving_signals import DrivingSignals
from emaphm.estimation.objective import MapObjective, faults_objective
from emaphm.estimation.problem import Problem
from emaphm.estimation.sensors.sensor_model import all_as_described
from emaphm.experiment.excitation import Excitation
from emaphm.optimizers import space_filling
from emaphm.random_streams import child_seed
from emaphm.recording import Recording, acquire, full_scales
from emaphm.recording.schema import SHORT_NAMES
from emaphm.simulation import AVERAGED, OBSERVABLE, REFERENCE, Initial, Inputs, Model, Plant, observe_batch

CONVERTER_BITS = 12
"""Assumed resolution of all channels except the current."""

LARGEST_SHORT = 0.7
"""Largest short within the validity of the averaged model (docs/physics.md, section 5)."""

FEWEST_ROWS = 50
"""Rows of the shortest excitation: fewer have hardly any information on ten unknowns."""


@dataclass(frozen=True, eq=False)
class TestSetup:
    """The recording of a test.

    `channels` are schema names, the current first; `noise` is that of the current [A rms], and `sample_rate`
    is in Hz.
    """

    __test__ = False  # pytest would collect the class by its name

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
        """Return the set-up; `channels` are short or column names in `emaphm.recording.schema.SHORT_NAMES`.

        Raises
        ------
        MethodError, SignalError
            A channel is unknown or impossible for the actuator, the current is missing, or the noise or rate
            is not a positive number.
        """
        named = [SHORT_NAMES.get(name, name) for name in channels]
        known = SHORT_NAMES.values()
        for given, name in zip(channels, named, strict=True):
            if name not in known:
                raise MethodError(f"unknown channel '{given}'{nearest(given, (*SHORT_NAMES, *known))}")
        if "current_A" not in named:
            raise MethodError("faults are identified from the current; put current among the channels")
        if "voltage_V" in named and actuator.electrical is None:
            raise MethodError(
                f"channel 'voltage' needs an [electrical] section, which actuator '{actuator.name}' lacks"
            )
        if not 0 < noise < np.inf:
            raise SignalError(f"noise of {noise:g} A is no sensor's rms; give more than 0")
        if not 0 < sample_rate < np.inf:
            raise SignalError(f"sample rate of {sample_rate:g} Hz is impossible; give more than 0")
        ordered = tuple(name for name in known if name in named)
        return cls(actuator, ordered, noise, sample_rate, workers)

    @property
    def truth(self) -> Model:
        """The model that simulates the actuator: the reference model if it has three phases."""
        return REFERENCE if self.actuator.three_phases else AVERAGED

    def objective(self, excitation: Excitation) -> MapObjective:
        """Return the objective of a diagnosis for a recording of `excitation`, weighted by the noise.

        Raises
        ------
        SignalError
            The excitation is too short, or does not move the actuator.
        """
        driving = self._driving(excitation)
        healthy = self._signals(excitation, HEALTHY.vector[np.newaxis], AVERAGED)[0]
        if np.ptp(healthy["position_rad"]) <= LEAST_MOTION * np.ptp(healthy["command_rad"]):
            raise SignalError("the excitation does not move the actuator; give it more amplitude or time")
        problem = Problem(
            self.actuator,
            AVERAGED,
            driving,
            driving.inputs(AVERAGED.step_for(self.actuator)),
            self._start(excitation),
            {name: healthy[name] for name in ("command_rad", *self.channels)},
            self.channels,
            workers=self.workers,
        )
        weighted = problem.weighted(self._noises(healthy))
        return faults_objective(weighted, None).scale_prior(self.noise)

    def record(self, excitation: Excitation, faults: Array, seed: int) -> list[Recording]:
        """Return simulated recordings of `excitation` with each of `faults` (n, 8), by the model `truth`.

        The current has its noise, the other channels the rounding of a converter. With the same seed, a row
        of a fault vector has the same noise for all excitations.
        """
        recordings = []
        for i, exact in enumerate(self._signals(excitation, faults, self.truth)):
            recorded = {name: exact[name] for name in ("time_s", "command_rad", *self.channels)}
            scales = self._full_scales(exact)
            recordings.append(
                acquire(
                    Recording(recorded, self.actuator.channels.sampling, "simulated"),
                    noise={"current_A": self.noise},
                    adc_bits=CONVERTER_BITS if scales else None,
                    full_scale=scales,
                    seed=child_seed(seed, "sensor noise", i),
                )
            )
        return recordings

    def faults(self, count: int, seed: int) -> Array:
        """Return representative fault vectors (count, 8): the healthy vector, and a space-filling design."""
        upper = np.ones(len(NAMES))
        upper[2:5] = LARGEST_SHORT
        if count == 1:
            return HEALTHY.vector[np.newaxis]
        others = space_filling(count - 1, np.zeros(len(NAMES)), upper, child_seed(seed, "fault vectors"))
        return np.concatenate([HEALTHY.vector[np.newaxis], others])

    def _driving(self, excitation: Excitation) -> DrivingSignals:
        samples = round(excitation.duration * self.sample_rate)
        if samples < FEWEST_ROWS:
            raise SignalError(
                f"{excitation.duration:g} s at {self.sample_rate:g} Hz are {samples} rows; give time or rate "
                f"for {FEWEST_ROWS} or more"
            )
        channels, interval = self.actuator.channels, 1 / self.sample_rate
        command = sample_held(excitation.command, interval, channels.command_held)
        return DrivingSignals(command, 0.0, samples, interval, channels.sampling)

    def _command_rows(self, excitation: Excitation, inputs: Inputs) -> Array:
        """Return the recorded rows (samples,) of the command, which is that of its time where it is held."""
        if self.actuator.channels.command_held:
            return excitation.command(inputs.time_s)
        return inputs.rows(inputs.command)

    def _start(self, excitation: Excitation) -> Initial:
        return Initial(excitation.rests_at / self.actuator.mechanics.gear_ratio)

    def _signals(self, excitation: Excitation, faults: Array, model: Model) -> list[dict[str, Array]]:
        """Return all observable channels, noise-free, for each of `faults` (n, 8)."""
        inputs = self._driving(excitation).inputs(model.step_for(self.actuator))
        given = {"time_s": inputs.time_s, "command_rad": self._command_rows(excitation, inputs)}
        plant, start = Plant.of(self.actuator, faults), self._start(excitation)
        exact = observe_batch(model, plant, inputs, start, workers=self.workers)
        signals = all_as_described(exact, OBSERVABLE, self.actuator, inputs.interval)
        return [given | dict(zip(OBSERVABLE, rows, strict=True)) for rows in signals]

    def _noises(self, signals: dict[str, Array]) -> Array:
        """Return the rms noise (channels,): that of the current, and the rounding of the other converters."""
        steps = [2 * scale / 2**CONVERTER_BITS for scale in self._full_scales(signals).values()]
        return np.array([self.noise, *(step / 12**0.5 for step in steps)])

    def _full_scales(self, signals: dict[str, Array]) -> dict[str, float]:
        """Return half the converter's range of each channel except the current.

        It is twice the channel's peak if the description has no range for the channel.
        """
        described = full_scales(self.actuator)
        return {
            name: described.get(name, 2 * float(np.max(np.abs(signals[name])))) for name in self.channels[1:]
        }
