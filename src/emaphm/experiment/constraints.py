"""Constraints on an excitation: amplitude, frequency, duration."""

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
    """Largest amplitude [rad] at the user, frequency [Hz] (inf without a limit), and duration [s].

    `about` [rad] is the initial rest position of the given excitation, and the centre of a chirp.
    """

    amplitude: float
    frequency: float
    duration: float
    about: float = 0.0

    def chirp(self, shares: Array) -> Excitation:
        """Return the chirp of `shares` (3,) of the limits: amplitude, first and last frequency.

        It has the largest duration, because more rows always add information.
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
        """Return the constraints; a limit of None is that of the `given` excitation.

        With `searching`, chirps up to all limits must be possible, otherwise only the given excitation.

        Raises
        ------
        SignalError
            No excitation satisfies the constraints, or the given one does not.
        """
        of_given = {"amplitude": given.amplitude, "frequency": given.frequency_hz, "duration": given.duration}
        requested = {"amplitude": amplitude, "frequency": frequency, "duration": duration}
        limits = {}
        for name, value in requested.items():
            own = of_given[name]
            limit = own if value is None else value
            if limit is None and not searching:
                limits[name] = np.inf
                continue
            if limit is None:
                raise SignalError(
                    "this command has no highest frequency of its own; give one (--max-frequency), or search "
                    "no chirps (--candidates 0)"
                )
            if not 0 < limit < np.inf:
                raise SignalError(f"largest {name} of {limit:g} leaves no manoeuvre; give more than 0")
            if own is not None and own > limit:
                raise SignalError(
                    f"the given manoeuvre exceeds the largest {name}: {own:g} is more than {limit:g}; reduce "
                    f"its {name}, or give a larger --max-{name}"
                )
            limits[name] = limit
        constraints = cls(**limits, about=given.rests_at)
        setup.actuator.mechanics.check_start(constraints.about)
        constraints._check(setup, *given.range)
        if searching:
            about, size = constraints.about, constraints.amplitude
            constraints._check(setup, about - size, about + size)
        return constraints

    def _check(self, setup: TestSetup, lowest: float, highest: float) -> None:
        """Raise `SignalError` if actuator or recorder cannot follow a command from `lowest` to `highest`."""
        mechanics, rate = setup.actuator.mechanics, setup.sample_rate
        if mechanics.end_stops and not mechanics.encloses(lowest, highest):
            size = max(self.about - lowest, highest - self.about)
            raise SignalError(self._beyond_end_stops(size, mechanics.end_stops))
        if rate / 2 < self.frequency < np.inf:
            raise SignalError(
                f"{self.frequency:g} Hz cannot be recorded at {rate:g} Hz; give {rate / 2:g} or less"
            )
        if self.duration > LONGEST_S:
            raise SignalError(f"{self.duration:g} s are too long for a design; give {LONGEST_S:g} or less")

    def _beyond_end_stops(self, amplitude: float, stops: tuple[float, float]) -> str:
        """Return the message on an `amplitude` that exceeds the end stops `stops`, with the possible one."""
        middle, room = (stops[0] + stops[1]) / 2, min(self.about - stops[0], stops[1] - self.about)
        place = f" about {self.about:g}" if self.about else ""
        text = f"amplitude {amplitude:g}{place} is beyond the end stops {list(stops)}"
        text += f"; give {max(room, 0.0):g} or less"
        if self.about == middle:
            return text
        return f"{text}, or start in the middle (--about {middle:g}), where {middle - stops[0]:g} is possible"
