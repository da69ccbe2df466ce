"""Options of a manoeuvre: a named command or one from a file, its duration, and the sampling rate."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from emaphm.cli.options.values import signal_in
from emaphm.errors import SignalError

if TYPE_CHECKING:
    from collections.abc import Callable

    from emaphm.actuator import Actuator, Command, Sampled

AMPLITUDE = 5e-3
"""Default amplitude of a named command, at the user [rad]."""

REST_BEFORE_STEP = 0.1
"""Share of the duration after which the named step begins: without a rest, all its rows would be equal."""

FREQUENCIES = {"chirp": 15.0, "decaying-chirp": 15.0, "sine": 4.0}
"""Default frequency of the named commands that have one: of the sine, and the final one of a chirp [Hz]."""

NAMED_COMMANDS = ("chirp", "decaying-chirp", "step", "ramp", "sine")

ONE_SIDED = ("step", "ramp")
"""Named commands that move to one side of their start only."""

JUMP = 0.05
"""Distance from the resting shaft to a command's first value that counts as a jump, relative to the command's
range."""

EVALUATED_TIMES = 10_000
"""Number of times at which a command is evaluated to find its range."""


@Parameter(name="*")
@dataclass(frozen=True)
class Manoeuvre:
    """Options of a manoeuvre, for `simulate`, `design` and `train`."""

    command: Annotated[
        str,
        Parameter(
            help="Command: chirp, decaying-chirp, step (after a tenth of the duration), ramp or sine; or a "
            "file with the columns time_s and command_rad."
        ),
    ] = "chirp"
    amplitude: Annotated[
        float | None,
        Parameter(help="Amplitude of a named command, at the user [rad; m if linear]; default 0.005."),
    ] = None
    frequency: Annotated[
        float | None,
        Parameter(help="Frequency of the sine, default 4, or final frequency of a chirp, default 15 [Hz]."),
    ] = None
    about: Annotated[
        float | None,
        Parameter(
            help="Initial position of the shaft, at rest, at the user [rad; m if linear]; a named command is "
            "relative to it. Default 0; if an end stop is too near for a named command, the position that "
            "puts the command in the middle of the travel."
        ),
    ] = None
    duration: Annotated[float, Parameter(help="Duration of the recording [s].")] = 0.5
    sample_rate: Annotated[float, Parameter(help="Sampling rate of the recording [Hz].")] = 5000.0

    def command_for(self, actuator: "Actuator") -> "Command":
        """Return the command, with room between the end stops of `actuator`.

        Raises
        ------
        SignalError
            The command is unknown or not finite, or its options contradict each other.
        """
        self._check()
        if self.command in NAMED_COMMANDS:
            return self._named_command(actuator)
        if not Path(self.command).suffix:
            raise SignalError(
                f"unknown command '{self.command}' (known: {', '.join(NAMED_COMMANDS)}); or give a file such "
                "as command.csv"
            )
        if self.amplitude is not None:
            raise SignalError(f"--amplitude is of {', '.join(NAMED_COMMANDS)}; leave it out with a file")
        signal = signal_in(self.command, "command_rad", self.duration)
        if self._is_still(signal) and (rest := self._rest_of(signal)):
            raise SignalError(rest)
        return signal

    def notes_on(self, command: "Command") -> list[str]:
        """Return notes on a command from a file: it starts with a jump, or goes on after the duration."""
        if self.command in NAMED_COMMANDS:
            return []
        return [note for note in (self._jump_of(command), self._rest_of(command)) if note]

    def _is_still(self, signal: "Sampled") -> bool:
        """Return whether a command from a file keeps its first value during the duration."""
        import numpy as np

        used = signal.values[signal.time_s < self.duration]
        return bool(np.all(used == used[:1]) and np.all(signal(np.array(self.duration)) == used[:1]))

    def _rest_of(self, command: "Command") -> str | None:
        """Return a note if a command from a file still changes after the duration, otherwise None."""
        import numpy as np

        from emaphm.actuator import Sampled

        if not isinstance(command, Sampled):
            return None
        end = command(np.array(self.duration))
        if np.all(command.values[command.time_s > self.duration] == end):
            return None
        last = f"{command.time_s[-1]:g}"
        return (
            f"{self.command}: the command goes on to {last} s, but only {self.duration:g} s of it are used; "
            f"to use all of it, give --duration {last}"
        )

    def _jump_of(self, command: "Command") -> str | None:
        """Return a note if a command from a file starts away from the resting shaft, otherwise None."""
        import numpy as np

        from emaphm.actuator.commands import rest_position

        values = command(np.linspace(0.0, self.duration, EVALUATED_TIMES))
        first, start = float(values[0]), rest_position(command, self.about)
        if abs(first - start) <= JUMP * np.ptp(values):
            return None
        return (
            f"{self.command}: the command starts at {first:g}, but the shaft rests at {start:g}, so the "
            f"command begins with a jump; to start the shaft at {first:g}, give --about {first:g}"
        )

    def _check(self) -> None:
        if not self.duration > 0:
            raise SignalError(f"--duration {self.duration:g}: give more than 0 s")
        for name in ("amplitude", "frequency", "about"):
            value = getattr(self, name)
            if value is not None and not math.isfinite(value):
                raise SignalError(f"the command is not finite with --{name} {value}; give a number")
        if self.frequency is not None and self.frequency < 0:
            raise SignalError(f"--frequency {self.frequency:g}: give 0 Hz or more")
        if self.frequency is not None and self.command not in FREQUENCIES:
            raise SignalError(
                f"--frequency is of {', '.join(FREQUENCIES)}; leave it out with '{self.command}'"
            )
        if self._highest_hz > self.sample_rate / 2 > 0:
            raise SignalError(
                f"--frequency {self._highest_hz:g} Hz is above half of the {self.sample_rate:g} rows a "
                "second (aliasing); give a lower frequency, or a higher --sample-rate"
            )

    @property
    def _highest_hz(self) -> float:
        return FREQUENCIES.get(self.command, 0.0) if self.frequency is None else self.frequency

    def _named_command(self, actuator: "Actuator") -> "Command":
        from emaphm.actuator import Chirp, DecayingChirp, Ramp, Sine, Step

        amplitude = AMPLITUDE if self.amplitude is None else self.amplitude
        duration, highest = self.duration, self._highest_hz
        about = self.about
        if about is None:
            extremes = (0.0, amplitude) if self.command in ONE_SIDED else (-amplitude, amplitude)
            about = actuator.mechanics.start_for(min(extremes), max(extremes))
        makers: dict[str, Callable[[], Command]] = {
            "chirp": lambda: Chirp(amplitude, stop_hz=highest, duration=duration, about=about),
            "decaying-chirp": lambda: DecayingChirp(
                amplitude, stop_hz=highest, duration=duration, about=about
            ),
            "step": lambda: Step(amplitude, REST_BEFORE_STEP * duration, about),
            "ramp": lambda: Ramp(amplitude / duration, about=about),
            "sine": lambda: Sine(amplitude, highest, about),
        }
        return makers[self.command]()
