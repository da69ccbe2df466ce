"""The constraints on an excitation: amplitude, frequency, duration."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from emaphm.actuator import Chirp
from emaphm.arrays import Array
from emaphm.errors import SignalError
from emaphm.estimation.discrepancy import LONGEST_S
from emaphm.experiment.excitation import Excitation
from emaphm.experiment.test_setup import TestSetup


@dataclass(frozen=True)
class Constraints:
    """Largest amplitude [rad] at the user, frequency [Hz], inf without a limit, and duration [s].

    `about` [rad] is where the excitation given rests first, and a chirp moves about.
    """

    amplitude: float
    frequency: float
    duration: float
    about: float = 0.0

    def chirp(self, shares: Array) -> Excitation:
        """Return the chirp of `shares` (3,) of the limits: amplitude, first and last frequency.

        It lasts as long as it may: more rows only add information.
        """
        size, start, stop = (float(share) for share in shares)
        command = Chirp(
            size * self.amplitude, start * self.frequency, stop * self.frequency, self.duration, self.about
        )
        return Excitation(command, self.duration)

    @classmethod
    def of(
        cls,
        setup: TestSetup,
        given: Excitation,
        amplitude: float | None,
        frequency: float | None,
        duration: float | None,
        *,
        searching: bool,
    ) -> Self:
        """Return the constraints, those of the `given` excitation where left out.

        With `searching`, chirps that use all of them must be possible, else the given excitation alone.

        Raises
        ------
        SignalError
            No excitation can keep them, or the given one does not.
        """
        own = {"amplitude": given.amplitude, "frequency": given.frequency_hz, "duration": given.duration}
        wanted = {"amplitude": amplitude, "frequency": frequency, "duration": duration}
        limits = {}
        for name, value in wanted.items():
            mine = own[name]
            limit = mine if value is None else value
            if limit is None and not searching:
                limits[name] = np.inf
                continue
            if limit is None:
                raise SignalError(
                    "this command has no highest frequency of its own; give one (--max-frequency), or try no "
                    "others (--candidates 0)"
                )
            if not 0 < limit < np.inf:
                raise SignalError(f"largest {name} of {limit:g} leaves no excitation; give more than 0")
            if mine is not None and mine > limit:
                raise SignalError(
                    f"the given excitation exceeds the largest {name}: {mine:g} is more than {limit:g}; make "
                    "it less, or allow more"
                )
            limits[name] = limit
        found = cls(**limits, about=given.rests_at)
        setup.actuator.mechanics.check_start(found.about)
        found._check(setup, *given.range)
        if searching:
            found._check(setup, found.about - found.amplitude, found.about + found.amplitude)
        return found

    def _check(self, setup: TestSetup, lowest: float, highest: float) -> None:
        """Refuse limits, and commands from `lowest` to `highest`, that actuator or recorder cannot follow."""
        mechanics, rate = setup.actuator.mechanics, setup.sample_rate
        if mechanics.end_stops and not mechanics.encloses(lowest, highest):
            size = max(self.about - lowest, highest - self.about)
            raise SignalError(self._beyond(size, mechanics.end_stops))
        if rate / 2 < self.frequency < np.inf:
            raise SignalError(
                f"{self.frequency:g} Hz cannot be recorded at {rate:g} Hz; give {rate / 2:g} or less"
            )
        if self.duration > LONGEST_S:
            raise SignalError(f"{self.duration:g} s are too long for a design; give {LONGEST_S:g} or less")

    def _beyond(self, amplitude: float, stops: tuple[float, float]) -> str:
        """Return what is wrong with an `amplitude` that the end stops leave no room for."""
        middle, room = (stops[0] + stops[1]) / 2, min(self.about - stops[0], stops[1] - self.about)
        place = f" about {self.about:g}" if self.about else ""
        text = f"amplitude {amplitude:g}{place} is beyond the end stops {list(stops)}"
        text += f"; give {max(room, 0.0):g} or less"
        if self.about == middle:
            return text
        return f"{text}, or start in the middle (--about {middle:g}), where {middle - stops[0]:g} is possible"
