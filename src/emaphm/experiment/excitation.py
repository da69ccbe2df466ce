"""The excitation of a test: a command and its duration."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from emaphm.actuator import Chirp, Command, DecayingChirp, Sampled, Sine, Step
from emaphm.actuator.commands import rest_position
from emaphm.actuator.quantity import USER_ANGLE, unit_for
from emaphm.arrays import Array
from emaphm.output_files import write_table

PERIOD_ROWS = 200
"""Rows of a written command in its shortest period: linear interpolation has an error of a ten-thousandth."""

EDGE_S = 1e-9
"""Rise time of a written step [s]: far less than a time step of any model."""


@dataclass(frozen=True)
class Excitation:
    """A `command` of the `duration` [s], from rest at `start` [rad] at the user.

    If `start` is None, the command starts at its own rest position (`rest_position`).
    """

    command: Command
    duration: float
    start: float | None = None

    @property
    def rests_at(self) -> float:
        """The initial rest position [rad] at the user."""
        return rest_position(self.command, self.start)

    @property
    def amplitude(self) -> float:
        """The largest distance of the command from the initial rest position [rad] at the user."""
        if isinstance(self.command, Chirp | DecayingChirp | Sine | Step):
            return abs(self.command.amplitude) + abs(self.command.about - self.rests_at)
        return max(abs(extreme - self.rests_at) for extreme in self.range)

    @property
    def range(self) -> tuple[float, float]:
        """The lowest and the highest command [rad] at the user."""
        times = np.linspace(0.0, self.duration, 10_000)
        if isinstance(self.command, Sampled):  # its extremes are at its own rows
            times = np.append(times, self._own_times(self.command))
        values = self.command(times)
        return float(np.min(values)), float(np.max(values))

    @property
    def frequency_hz(self) -> float | None:
        """The highest frequency [Hz]; None if the command is not described by frequencies."""
        if isinstance(self.command, Chirp | DecayingChirp):
            return max(abs(self.command.start_hz), abs(self._last_hz(self.command)))
        return abs(self.command.frequency_hz) if isinstance(self.command, Sine) else None

    def words(self, coordinates: str) -> str:
        """Return the excitation in words; lengths in the unit of the `coordinates`."""
        unit = unit_for(USER_ANGLE, coordinates)
        size = f"{getattr(self.command, 'amplitude', self.amplitude):.4g} {unit}"
        if isinstance(self.command, Chirp | DecayingChirp):
            kind = "chirp" if isinstance(self.command, Chirp) else "decaying chirp"
            last = self._last_hz(self.command)
            signal = f"{kind} of {size}, {self.command.start_hz:.3g} to {last:.3g} Hz"
        elif isinstance(self.command, Sine):
            signal = f"sine of {size}, {self.command.frequency_hz:.3g} Hz"
        else:
            signal = f"{self._kind} of up to {size}"
        about, rest = rest_position(self.command), self.rests_at
        place = f" about {about:.4g} {unit}" if about else ""
        start = f", from rest at {rest:.4g} {unit}" if rest != about else ""
        return f"{signal}{place}, {self.duration:.3g} s{start}"

    def played(self, coordinates: str) -> str:
        """Return the duration, and the initial rest position if it is not 0, in words."""
        place = (
            f", from rest at {self.rests_at:.4g} {unit_for(USER_ANGLE, coordinates)}" if self.rests_at else ""
        )
        return f"it lasts {self.duration:g} s{place}"

    def to_dict(self) -> dict[str, Any]:
        """Return the excitation for JSON: its kind, parameters and duration."""
        known = isinstance(self.command, Chirp | DecayingChirp | Sine | Step)
        described: dict[str, Any] = vars(self.command) if known else {}
        return described | {
            "command": self._kind,
            "amplitude": self.amplitude,
            "initial_position": self.rests_at,
            "duration_s": self.duration,
        }

    def write(self, path: str | Path, sample_rate: float) -> None:
        """Write the command for `emaphm simulate --command`: to CSV, or to Parquet if `path` ends so.

        A command from a file is written with its own rows, any other command at `sample_rate` [Hz] or faster.
        An existing file is replaced.

        Raises
        ------
        OutputError
            The file cannot be written; no partial file is left.
        """
        import polars as pl

        t = self._written_times(sample_rate)
        write_table(pl.DataFrame({"time_s": t, "command_rad": self.command(t)}), path)

    def _written_times(self, sample_rate: float) -> Array:
        """Return the times [s] of the rows, between which the command is interpolated linearly."""
        if isinstance(self.command, Sampled):
            return np.concatenate([[0.0], self._own_times(self.command), [self.duration]])
        rate = max(sample_rate, PERIOD_ROWS * (self.frequency_hz or 0.0))
        t = np.linspace(0.0, self.duration, round(self.duration * rate) + 1)
        if isinstance(self.command, Step) and 0 < self.command.start <= self.duration:
            edge = np.array([max(self.command.start - EDGE_S, 0.0), self.command.start])
            t = np.union1d(t[(t < edge[0]) | (t > edge[1])], edge)
        return t

    def _own_times(self, command: Sampled) -> Array:
        """Return the times [s] of the rows of a command from a file, between the start and the end."""
        t = command.time_s
        return t[(t > 0) & (t < self.duration)]

    def _last_hz(self, chirp: Chirp | DecayingChirp) -> float:
        """Return the frequency [Hz] at the end; a chirp continues its sweep beyond its own duration."""
        share = self.duration / chirp.duration
        if isinstance(chirp, DecayingChirp):
            share = min(share, 1.0)  # 0 from then on
        return (1 - share) * chirp.start_hz + share * chirp.stop_hz

    @property
    def _kind(self) -> str:
        if isinstance(self.command, Sampled):
            return "command from a file"
        name = getattr(self.command, "__name__", type(self.command).__name__)
        return {"DecayingChirp": "decaying-chirp"}.get(name, name.lower())
