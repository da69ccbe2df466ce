"""The options of a manoeuvre: a command by name or from a file, its duration, and the rows a second."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from emaphm.cli.options.values import signal_in
from emaphm.errors import SignalError

if TYPE_CHECKING:
    from collections.abc import Callable

    from emaphm.actuator import Actuator, Command

AMPLITUDE = 5e-3
"""Of a command by name [rad]."""

REST_BEFORE_STEP = 0.1
"""Share of the duration after which a step by name begins: without a rest its rows would be all the same."""

FREQUENCIES = {"chirp": 15.0, "decaying-chirp": 15.0, "sine": 4.0}
"""Of the commands that have one: of the sine, and the last of a chirp [Hz]."""

BY_NAME = ("chirp", "decaying-chirp", "step", "ramp", "sine")

ONE_WAY = ("step", "ramp")
"""Of these the commands that leave their start to one side only."""

JUMP = 0.05
"""Distance of a command's first value from the resting shaft, of what it covers, from which it is a jump."""

ROWS_SEEN = 10_000
"""Times at which a command is looked at for what it covers."""


@Parameter(name="*")
@dataclass(frozen=True)
class Manoeuvre:
    """What `simulate`, `design` and `train` take of a manoeuvre."""

    command: Annotated[
        str,
        Parameter(
            help="chirp, decaying-chirp, step (after a tenth of the duration), ramp, sine, or a file with "
            "time_s and command_rad."
        ),
    ] = "chirp"
    amplitude: Annotated[
        float | None, Parameter(help="Of a command by name, at the user [rad]; 0.005 if left out.")
    ] = None
    frequency: Annotated[
        float | None, Parameter(help="Of the sine, or the last of a chirp [Hz]; 4 and 15 if left out.")
    ] = None
    about: Annotated[
        float | None,
        Parameter(
            help="Where the shaft rests first, at the user [rad]; a command by name is counted from there. "
            "0 if left out; where an end stop is too near for a command by name, such that the command is in "
            "the middle of the travel."
        ),
    ] = None
    duration: Annotated[float, Parameter(help="Of the recording [s].")] = 0.5
    sample_rate: Annotated[float, Parameter(help="Rows a second [Hz].")] = 5000.0

    def command_for(self, actuator: "Actuator") -> "Command":
        """Return the command, with room between the end stops of `actuator`.

        Raises
        ------
        SignalError
            It is unknown, not finite, or what the options say of it does not fit together.
        """
        self._check()
        if self.command in BY_NAME:
            return self._by_name(actuator)
        if not Path(self.command).suffix:
            raise SignalError(
                f"unknown command '{self.command}' (known: {', '.join(BY_NAME)}); or give a file such as "
                "command.csv"
            )
        if self.amplitude is not None:
            raise SignalError(f"--amplitude is of {', '.join(BY_NAME)}; leave it out with a file")
        return signal_in(self.command, "command_rad", self.duration)

    def jump_of(self, command: "Command") -> str | None:
        """Return that a command from a file begins elsewhere than the shaft rests; None where it does not."""
        if self.command in BY_NAME:
            return None
        import numpy as np

        from emaphm.actuator.commands import rest_position

        values = command(np.linspace(0.0, self.duration, ROWS_SEEN))
        first, start = float(values[0]), rest_position(command, self.about)
        if abs(first - start) <= JUMP * np.ptp(values):
            return None
        return (
            f"{self.command}: the command begins at {first:g}, the shaft at {start:g}: it jumps there. With "
            f"--about {first:g} it would rest there"
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
                "second, which would show another motion; give a lower one, or a higher --sample-rate"
            )

    @property
    def _highest_hz(self) -> float:
        return FREQUENCIES.get(self.command, 0.0) if self.frequency is None else self.frequency

    def _by_name(self, actuator: "Actuator") -> "Command":
        from emaphm.actuator import Chirp, DecayingChirp, Ramp, Sine, Step

        amplitude = AMPLITUDE if self.amplitude is None else self.amplitude
        duration, highest = self.duration, self._highest_hz
        about = self.about
        if about is None:
            ways = (0.0, amplitude) if self.command in ONE_WAY else (-amplitude, amplitude)
            about = actuator.mechanics.start_for(min(ways), max(ways))
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
