"""What a manoeuvre will tell of each fault, and a search for one that tells more within the same limits."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from emaphm.actuator import NAMES, Actuator, Chirp, Command
from emaphm.errors import MethodError, SignalError
from emaphm.estimation.bias_correction import LONGEST_S
from emaphm.experiment.candidate_search import FEWEST_TESTS, Plan, choose, search
from emaphm.experiment.constraints import Limits
from emaphm.experiment.excitation import Manoeuvre
from emaphm.experiment.predicted_precision import Widths, expected
from emaphm.experiment.simulated_tests import CHANCE, Gain, prove
from emaphm.experiment.test_setup import Conditions
from emaphm.progress import Progress, subprogress
from emaphm.text_table import format_table
from emaphm.version import VERSION

if TYPE_CHECKING:
    from matplotlib.figure import Figure

VECTORS = 16
"""Fault vectors that an expectation is told about: the kernels take so many at once."""

SEARCHING, CHOOSING = 0.5, 0.75
"""Shares of the time after which the search and the choice of a finalist are done."""


@dataclass(frozen=True, eq=False)
class Design:
    """The manoeuvre `given`, the better one `found` (the given one where there is none), and the proof.

    `candidates` chirps were tried, and `tests` simulated for the given manoeuvre and each of the best;
    `gain` is what the best of these gained, nothing where none was expected to.
    """

    conditions: Conditions
    given: Plan
    found: Plan
    gain: Gain | None
    candidates: int
    tests: int
    seed: int

    @property
    def better(self) -> bool:
        """Whether a better manoeuvre than the given one was found."""
        return self.found is not self.given

    def to_dict(self) -> dict[str, Any]:
        """Return what `emaphm design --json` prints."""
        gain = self.gain
        return {
            "given": self.given.to_dict(),
            "found": self.found.to_dict(),
            "better": self.better,
            "gain": None if gain is None else vars(gain),
            "proven_by": self.conditions.truth.name if self.tests else None,
            "candidates": self.candidates,
            "tests": self.tests,
            "channels": list(self.conditions.channels),
            "noise_A": self.conditions.noise,
            "sample_rate_hz": self.conditions.sample_rate,
            "actuator": self.conditions.actuator.name,
            "seed": self.seed,
            "version": VERSION,
        }

    def write_command(self, path: str | Path) -> None:
        """Write the command found to a CSV file, as `emaphm simulate --command` plays it."""
        self.found.manoeuvre.write(path, self.conditions.sample_rate)

    def plot(self) -> "Figure":
        """Draw the commands and their half-widths, given and found."""
        from emaphm.plotting.design import draw_design

        return draw_design(self)

    def __str__(self) -> str:
        """Return the manoeuvres, a table of half-widths, and how sure it is that the one found is better."""
        coordinates = self.conditions.actuator.coordinates
        plans = {"given": self.given} | ({"found": self.found} if self.better else {})
        lines = [f"{label}: {plan.manoeuvre.words(coordinates)}" for label, plan in plans.items()]
        columns = []
        for label, plan in plans.items():
            columns.append((f"{label}, expected", plan.expected))
            if plan.proven is not None:
                columns.append((f"{label}, proven", plan.proven.widths))
        rows = [(name, *(_width(widths, name) for _, widths in columns)) for name in NAMES]
        table = format_table(("95 % interval ±", *(label for label, _ in columns)), rows)
        return "\n".join([*lines, "", table, "", *self.notes()])

    def notes(self) -> list[str]:
        """Return lines: what the table is, how it was proven, and whether anything better was found."""
        conditions = self.conditions
        told = (
            "Medians over faults that fill their range; recorded: "
            f"{', '.join(conditions.channels)}; current noise {conditions.noise:.3g} A rms; "
            f"{conditions.sample_rate:g} Hz."
        )
        given, found = self.given.proven, self.found.proven
        if given is None or found is None:
            return [told, "Not proven by simulated tests: none were asked for.", self._verdict()]
        proof = (
            f"Proven by diagnoses of {self.tests} tests that the {conditions.truth.name} model simulated; "
            f"median error of the given manoeuvre {given.median_error:.2f} %"
        )
        proof += f", of the one found {found.median_error:.2f} %." if self.better else "."
        lines = [told, proof]
        if conditions.actuator.electrical is None:
            lines.append(
                "Without [electrical] there is no reference model: the model that is fitted stands for the "
                "actuator too, and what it lacks is in no figure here."
            )
        return [*lines, self._verdict()]

    def _verdict(self) -> str:
        """Return whether a better manoeuvre was found, and how sure that is."""
        if not self.candidates:
            return "No better manoeuvre was searched for."
        searched = f"{self.candidates} chirps within the limits"
        if self.gain is None:
            return f"Nothing better was found: of {searched} none is expected to tell more."
        widths = _change(self.gain.narrower, self.gain.narrower_error, "narrower", "wider")
        errors = _change(self.gain.nearer, self.gain.nearer_error, "smaller", "larger")
        if self.better:
            return f"Found among {searched}: intervals {widths}, errors {errors} (standard errors)."
        return (
            f"Nothing better was found: the best of {searched} has intervals {widths} and errors {errors} "
            f"(standard errors); {CHANCE:g} standard errors narrower, and no larger errors, would be better."
        )


def _change(logarithm: float, error: float, less: str, more: str) -> str:
    """Return in words how much something has shrunk, `logarithm` being that of the ratio."""
    ratio = float(np.exp(-logarithm))
    word = less if logarithm > 0 else more
    return f"{word} by {100 * abs(1 - ratio):.0f} ± {100 * ratio * error:.0f} %"


def _width(widths: Widths, name: str) -> str:
    if name not in widths.half_widths:
        return "not shown"
    return f"{widths.half_widths[name]:.4f}" if widths.told(name) else "cannot tell"


def design(
    actuator: Actuator,
    command: Command = Chirp(),  # noqa: B008 - frozen
    *,
    duration: float = 0.5,
    max_amplitude: float | None = None,
    max_frequency: float | None = None,
    max_duration: float | None = None,
    channels: Sequence[str] = ("current",),
    noise: float = 0.05,
    sample_rate: float = 5000.0,
    candidates: int = 48,
    tests: int = 12,
    seed: int = 0,
    workers: int | None = None,
    on_progress: Progress | None = None,
) -> Design:
    """Return how well `command` will identify each fault, and a chirp that does better if there is one.

    Searched is the least mean, over faults and over representative fault vectors, of the logarithm of the
    expected half-width. Of the best few, tests simulated by the reference model choose one, and further
    tests under other faults compare it with the given manoeuvre. It counts as better if its intervals are
    narrower by more than two standard errors, and its errors are not larger by as much.

    Parameters
    ----------
    command, duration
        The manoeuvre given: position of the user [rad] as a function of time, and how long it lasts [s].
    max_amplitude, max_frequency, max_duration
        Limits of a better one, [rad] at the user, [Hz], [s]; those of the given one where left out.
    channels
        What will be recorded: names of `emaphm.experiment.test_setup.CHANNELS`.
    noise, sample_rate
        Of the current's sensor, rms [A]; rows a second [Hz].
    candidates
        Chirps to try; 0 to tell only of the given manoeuvre.
    tests
        Simulated for each manoeuvre that is proven; 0 to leave the proof, and so any finding, out.
    seed, workers
        The same seed gives the same bits, whatever the number of threads.
    on_progress
        Called with the fraction done, from 0 to 1.

    Raises
    ------
    MethodError, SignalError
        A channel, limit, noise, rate or number is impossible, the given manoeuvre exceeds a limit or moves
        nothing.
    """
    _check_work(candidates, tests, seed)
    conditions = Conditions.of(actuator, channels, noise, sample_rate, workers)
    given = Manoeuvre(command, duration)
    if not 0 < duration <= LONGEST_S:
        raise SignalError(f"a manoeuvre of {duration:g} s cannot be planned; give up to {LONGEST_S:g} s")
    faults = conditions.faults(VECTORS, seed)
    limits = Limits.of(conditions, given, max_amplitude, max_frequency, max_duration) if candidates else None
    plan, best = Plan(given, expected(conditions, given, faults, seed)), None
    if limits is not None:
        searching = subprogress(on_progress, 0.0, SEARCHING)
        finalists = search(conditions, limits, plan, faults, candidates, seed, searching)
        best = choose(conditions, finalists, tests, seed + 1, subprogress(on_progress, SEARCHING, CHOOSING))
    if not tests:
        return Design(conditions, plan, plan, None, candidates, tests, seed)
    # Under faults and noise that have chosen nothing.
    plans = [plan] if best is None else [plan, best]
    proving = subprogress(on_progress, CHOOSING if candidates else 0.0, 1.0)
    proofs = prove(conditions, [one.manoeuvre for one in plans], tests, seed + 2, proving)
    proven = [replace(one, proven=proof) for one, proof in zip(plans, proofs, strict=True)]
    gain = None if best is None else Gain.of(proofs[0], proofs[1])
    found = proven[1] if gain is not None and gain.real else proven[0]
    return Design(conditions, proven[0], found, gain, candidates, tests, seed)


def _check_work(candidates: int, tests: int, seed: int) -> None:
    """Refuse work that cannot be done, or would show nothing."""
    if seed < 0:
        raise SignalError(f"seed {seed} is negative; give 0 or more")
    if candidates < 0:
        raise MethodError(f"{candidates} candidates cannot be tried; give 0 or more")
    if tests != 0 and tests < FEWEST_TESTS:
        raise MethodError(f"{tests} tests prove nothing; give {FEWEST_TESTS} or more, or 0 for no proof")
    if candidates and not tests:
        raise MethodError(
            "what is found without tests is not proven to be better; give some (--tests), or try no others "
            "(--candidates 0)"
        )
