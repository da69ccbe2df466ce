"""The scope of an estimator: one actuator, one manoeuvre, the recorded channels, and their noise."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np

from emaphm.actuator import Actuator, Command
from emaphm.actuator.commands import rest_position, sample_held
from emaphm.arrays import Array
from emaphm.errors import MethodError, nearest
from emaphm.estimation.compared_channels import comparable_channels
from emaphm.estimation.space.nuisances import NuisanceSet
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.recording import Recording, full_scales
from emaphm.recording.acquisition import check_bits
from emaphm.recording.schema import CURRENTS, SHORT_NAMES
from emaphm.simulated_recording import simulate
from emaphm.simulation import Initial, Inputs

MOST_ROWS = 20_000
"""Longest recording that an estimator is trained on [rows]: 4 s at 5 kHz. A row takes 8 bytes of a shard."""

COMMAND_TOLERANCE = 5e-3
"""Largest difference of a recorded command from that of the training, relative to its range. With a larger
difference it is another manoeuvre. In the default chirp, instantaneous rows differ from means by 1 % of the
range."""

RATE_TOLERANCE = 1e-3
"""Largest relative difference of the sampling interval."""


@dataclass(frozen=True, eq=False)
class RecordingSetup:
    """An actuator, a manoeuvre from rest, and how it is recorded.

    Attributes
    ----------
    actuator
        The description: parameters, laws, sensors, priors of nuisances, and baseline.
    command_rad, interval_s
        Rows of the command (samples,), and their sampling interval [s]; `sampling` as in `Recording`.
    channels
        The channels that the estimator reads, the current first.
    noise
        White noise on the currents, rms [A]; `adc_bits` is the resolution of the converters, None if exact.
    nuisances
        Names of the nuisances, or None for those of the actuator's description.
    initial_position
        Position of the user at rest, before the manoeuvre [rad; m if linear].
    """

    actuator: Actuator
    command_rad: Array
    interval_s: float
    sampling: str
    channels: tuple[str, ...]
    noise: float
    adc_bits: int | None
    nuisances: tuple[str, ...] | None = None
    initial_position: float = 0.0

    @classmethod
    def of(
        cls,
        actuator: Actuator,
        command: Command,
        *,
        duration: float = 0.5,
        sample_rate: float = 5000.0,
        channels: Sequence[str] = ("current_A", "voltage_V"),
        noise: float = 0.05,
        adc_bits: int | None = 12,
        nuisances: Sequence[str] | None = None,
        initial_position: float | None = None,
    ) -> Self:
        """Return the setup of a recording that follows `command` (see `emaphm.simulate`).

        `channels` are columns of a recording, or "current", "voltage", "position" and "speed" for short.

        Raises
        ------
        MethodError
            The actuator has no three phases, so that there is no switching to learn from; or the models have
            no such channel or nuisance, the recording would be too long, or its command goes beyond the end
            stops.
        """
        check_windings(actuator)
        channels = [SHORT_NAMES.get(name, name) for name in channels]
        check_channels(actuator, channels)
        if adc_bits is not None:
            check_bits(adc_bits)
        if duration * sample_rate > MOST_ROWS:
            raise MethodError(
                f"{duration * sample_rate:g} rows are too many to learn from, {MOST_ROWS} are possible; "
                "give a lower --sample-rate or a shorter --duration"
            )
        if not 0 <= noise < np.inf:
            raise MethodError(f"noise of {noise:g} A is no rms; give 0 or more")
        sampling = actuator.channels.sampling
        first = rest_position(command, initial_position)
        rows = simulate(
            actuator,
            command,
            initial_position=first,
            model="averaged",
            duration=duration,
            sample_rate=sample_rate,
            sampling=sampling,
        )
        _check_stops(actuator, rows)
        named = None if nuisances is None else tuple(nuisances)
        ordered = tuple(sorted(dict.fromkeys(channels), key=lambda name: name != "current_A"))
        NuisanceSet.of(actuator, named, ordered)  # raises here, not in the first worker that simulates
        command_rad = np.asarray(rows["command_rad"])
        return cls(actuator, command_rad, 1 / sample_rate, sampling, ordered, noise, adc_bits, named, first)

    @property
    def samples(self) -> int:
        """The number of rows of a recording."""
        return int(self.command_rad.size)

    @cached_property
    def space(self) -> ParameterSpace:
        """The estimated coordinates: faults, nuisances, and parameters that the baseline leaves open."""
        duration = self.samples * self.interval_s
        chosen = NuisanceSet.of(self.actuator, self.nuisances, self.channels, duration=duration)
        return ParameterSpace.of(self.actuator, chosen)

    @property
    def noise_of(self) -> dict[str, float]:
        """White noise of each channel, rms in its unit: the described sensor's, and `noise` on currents."""
        described = {name: self.actuator.sensors.of(name).noise for name in self.channels}
        added = {name: self.noise if name in CURRENTS else 0.0 for name in self.channels}
        return {name: float(np.hypot(described[name], added[name])) for name in self.channels}

    @property
    def resolution_of(self) -> dict[str, float]:
        """Step of the converter of each channel in its unit; 0 if it is exact."""
        ranges = full_scales(self.actuator) if self.adc_bits is not None else {}
        steps = {name: 2 * ranges[name] / 2 ** (self.adc_bits or 0) for name in ranges}
        return {
            name: max(steps.get(name, 0.0), self.actuator.sensors.of(name).resolution)
            for name in self.channels
        }

    def inputs(self, command: Command, step: float) -> Inputs:
        """Return the inputs of a run at each of its steps, which are at most `step` [s] long."""
        return Inputs.of(
            sample_held(command, self.interval_s, self.actuator.channels.command_held),
            samples=self.samples,
            interval=self.interval_s,
            step=step,
            sampling="instant" if self.sampling == "instant" else "mean",
        )

    @property
    def start(self) -> Initial:
        """Initial state of the motor: at rest at the initial position."""
        return Initial(self.initial_position / self.actuator.mechanics.gear_ratio)

    @property
    def reach(self) -> float:
        """Range of the command, or its largest distance from the initial position if larger, in its unit."""
        farthest = float(np.max(np.abs(self.command_rad - self.initial_position)))
        return max(float(np.ptp(self.command_rad)), farthest)

    def starts_there(self, start: Initial) -> bool:
        """Return whether a manoeuvre has the initial state of the training: at rest at the same position.

        No motion may have preceded it: a motion leaves the motor at a side of the backlash.
        """
        away = abs(start.angle - self.start.angle) * self.actuator.mechanics.gear_ratio
        return away <= COMMAND_TOLERANCE * self.reach and not (start.speed or start.rotor_offset or start.gap)

    def identity(self) -> dict[str, Any]:
        """Return the values that identify a training set, ready for `json.dumps`."""
        return {
            "actuator": self.actuator.model_dump(mode="json", exclude_none=True),
            "command": hashlib.sha256(self.command_rad.astype("<f8").tobytes()).hexdigest()[:16],
            "rows": self.samples,
            "interval_s": self.interval_s,
            "sampling": self.sampling,
            "channels": list(self.channels),
            "nuisances": None if self.nuisances is None else list(self.nuisances),
            "initial_position": self.initial_position,
        }


def actuator_hash(actuator: Actuator) -> str:
    """Return a digest of a description without the entries on files, requirements and the name."""
    values = actuator.model_dump(mode="json", exclude={"channels", "reading", "requirements", "name"})
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:16]


def check_windings(actuator: Actuator) -> None:
    """Raise `MethodError` for an actuator without three phases; the message gives a remedy."""
    if not actuator.three_phases:
        raise MethodError(
            f"actuator '{actuator.name}' has a drive of kind '{actuator.drive_kind}', not of three phases: a "
            "search is quick, and there is nothing to learn; leave the estimator out, or if it has three "
            "phases, describe its windings in [electrical] and their drive in [drive]"
        )


def check_channels(actuator: Actuator, channels: Sequence[str]) -> None:
    """Raise `MethodError` for channels that the models of `actuator` lack, or if no current is among them."""
    known = comparable_channels(actuator)
    for name in channels:
        if name not in known:
            raise MethodError(f"unknown channel '{name}'{nearest(name, known)}")
    if "current_A" not in channels:
        raise MethodError("'current_A' is missing from the channels; windings and magnets show in it alone")


def rows_of(recording: Mapping[str, Array] | Recording, channels: Sequence[str]) -> Array:
    """Return `channels` of a recording in single precision, (1, channels, samples)."""
    return np.stack([recording[name] for name in channels])[np.newaxis].astype(np.float32)


def _check_stops(actuator: Actuator, rows: Recording) -> None:
    command = np.asarray(rows["command_rad"])
    stops = list(actuator.mechanics.end_stops or ())
    if not actuator.mechanics.encloses(float(command.min()), float(command.max())):
        raise MethodError(
            f"the command goes from {command.min():.4g} to {command.max():.4g}, beyond the end stops "
            f"{stops}: give a smaller --amplitude, another place (--about), or another --command"
        )
