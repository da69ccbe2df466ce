"""Search for a manoeuvre that will identify the faults better, within what the test may do."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from emaphm.actuator import NAMES, Actuator, Chirp
from emaphm.errors import SignalError
from emaphm.identification.expected import Conditions, Expected, expected
from emaphm.identification.optimizers.space_filling import space_filling
from emaphm.identification.verdict import WIDEST_HALF_INTERVAL
from emaphm.identification.wording import format_table
from emaphm.version import VERSION

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CANDIDATES = 32
"""Manoeuvres a round of the search."""

SHRINK = (1.0, 0.4, 0.15)
"""Size of the box about the best manoeuvre in each round, as a share of the limits."""

LEAST_SHARE = 0.1
"""Least amplitude, last frequency and duration tried, as shares of their limits."""

LONGEST = 30.0
"""Longest manoeuvre [s]: a diagnosis corrects its model's bias up to there."""


@dataclass(frozen=True, eq=False)
class Design:
    """The manoeuvre given, the better one found, and what is expected of each."""

    actuator: Actuator
    given: Chirp
    found: Chirp
    before: Expected
    after: Expected
    sample_rate: float
    channels: tuple[str, ...]
    seed: int

    def to_dict(self) -> dict[str, Any]:
        """Return what `emaphm design --json` prints."""
        return {
            "given": vars(self.given),
            "found": vars(self.found),
            "before": self.before.half_widths,
            "after": self.after.half_widths,
            "objective_before": self.before.objective,
            "objective_after": self.after.objective,
            "channels": list(self.channels),
            "actuator": self.actuator.name,
            "seed": self.seed,
            "version": VERSION,
        }

    def write_command(self, path: Path) -> None:
        """Write the command found to a CSV file, as `emaphm simulate --command` reads it."""
        import polars as pl

        t = np.arange(round(self.found.duration * self.sample_rate) + 1) / self.sample_rate
        pl.DataFrame({"time_s": t, "command_rad": self.found(t)}).write_csv(path)

    def plot(self) -> "Figure":
        """Draw the commands and the expected half-widths, before and after."""
        from emaphm.identification.design_figure import draw_design

        return draw_design(self)

    def __str__(self) -> str:
        """Return both manoeuvres and a table of expected half-widths."""
        rows = [(name, _width(self.before, name), _width(self.after, name)) for name in NAMES]
        table = format_table(("component", "given, 95 % ±", "found, 95 % ±"), rows)
        return f"given: {_words(self.given)}\nfound: {_words(self.found)}\n\n{table}"


def _words(chirp: Chirp) -> str:
    return (
        f"chirp of {chirp.amplitude:.4g}, {chirp.start_hz:.3g} to {chirp.stop_hz:.3g} Hz "
        f"in {chirp.duration:.3g} s"
    )


def _width(result: Expected, name: str) -> str:
    if name not in result.half_widths:
        return "not seen"
    width = result.half_widths[name]
    return f"{width:.4f}" if width <= WIDEST_HALF_INTERVAL else "cannot be told"


def design(
    actuator: Actuator,
    *,
    given: Chirp | None = None,
    max_amplitude: float = 5e-3,
    max_frequency: float = 15.0,
    max_duration: float = 0.5,
    channels: Sequence[str] = ("current",),
    noise: float = 0.05,
    sample_rate: float = 5000.0,
    seed: int = 0,
    on_progress: Callable[[float], None] | None = None,
) -> Design:
    """Return the chirp within the limits that makes the expected intervals narrowest.

    Least is the mean, over the faults and over representative fault vectors, of the logarithm of the
    expected half-width: halving any interval is worth the same.

    Parameters
    ----------
    given
        What to compare with and start from; where left out, a chirp from 0 Hz at all three limits.
    max_amplitude, max_frequency, max_duration
        Limits of the manoeuvre, [rad] at the user, [Hz], [s].
    channels
        What will be recorded: names of `emaphm.identification.expected.CHANNELS`.
    noise, sample_rate
        Of the current's sensor, rms [A]; rows a second [Hz].

    Raises
    ------
    MethodError, SignalError
        A channel, limit, noise or rate is impossible, or nothing would move.
    """
    _check(actuator, max_amplitude, max_frequency, max_duration, sample_rate)
    conditions = Conditions.of(actuator, channels, noise, sample_rate, seed)
    limits = np.array([max_amplitude, max_frequency, max_frequency, max_duration])
    start = given or Chirp(max_amplitude, 0.0, max_frequency, max_duration)
    best = np.array([max_amplitude, 0.0, max_frequency, max_duration]) / limits
    least = expected(conditions, Chirp(*(best * limits)), ripple=False).objective
    lower = np.array([LEAST_SHARE, 0.0, LEAST_SHARE, LEAST_SHARE])
    for turn, size in enumerate(SHRINK):
        low = np.maximum(best - size, lower)
        tried = space_filling(CANDIDATES, low, np.minimum(best + size, 1.0), seed + turn)
        for i, candidate in enumerate(tried):
            try:
                value = expected(conditions, Chirp(*(candidate * limits)), ripple=False).objective
            except SignalError:
                continue  # too small to move the actuator
            if value < least:
                best, least = candidate, value
            if on_progress is not None:
                on_progress((turn * CANDIDATES + i + 1) / (len(SHRINK) * CANDIDATES))
    found = Chirp(*(float(value) for value in best * limits))
    before, after = expected(conditions, start), expected(conditions, found)
    return Design(actuator, start, found, before, after, sample_rate, conditions.channels, seed)


def _check(actuator: Actuator, amplitude: float, frequency: float, duration: float, rate: float) -> None:
    """Refuse limits that no manoeuvre can keep."""
    for name, value in (("amplitude", amplitude), ("frequency", frequency), ("duration", duration)):
        if not 0 < value < np.inf:
            raise SignalError(f"largest {name} of {value:g} leaves no manoeuvre; give more than 0")
    stops = actuator.mechanics.end_stops
    if stops and amplitude > (reach := min(map(abs, stops))):
        raise SignalError(
            f"amplitude {amplitude:g} is beyond the end stops {list(stops)}; give {reach:g} or less"
        )
    if frequency > rate / 2:
        raise SignalError(f"{frequency:g} Hz cannot be recorded at {rate:g} Hz; give {rate / 2:g} or less")
    if duration > LONGEST:
        raise SignalError(f"{duration:g} s are too long for a design; give {LONGEST:g} or less")
