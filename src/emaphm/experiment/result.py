"""Result of a design: the given test, the better test if there is one, and their comparison."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from emaphm.actuator import NAMES
from emaphm.experiment.candidate_search import PlannedTest
from emaphm.experiment.predicted_precision import Precision
from emaphm.experiment.simulated_tests import SIGNIFICANT, Gain
from emaphm.experiment.test_setup import TestSetup
from emaphm.text_table import format_table
from emaphm.version import VERSION

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDER = 2.0
"""Ratio of a simulated to a predicted interval above which simulated tests do not confirm the prediction."""


@dataclass(frozen=True, eq=False)
class Design:
    """The `given` test, the better test `found` (the given test if there is none), and their comparison.

    `candidates` is the number of evaluated chirps, `tests` that of the simulated tests of each compared test.
    `gain` compares the best finalist with the given test; None if no chirp was predicted to be better.
    """

    setup: TestSetup
    given: PlannedTest
    found: PlannedTest
    gain: Gain | None
    candidates: int
    tests: int
    seed: int

    @property
    def better(self) -> bool:
        """Whether a better test than the given one was found."""
        return self.found is not self.given

    def to_dict(self) -> dict[str, Any]:
        """Return the values that `emaphm design --json` prints."""
        gain = self.gain
        return {
            "given": self.given.to_dict(),
            "found": self.found.to_dict(),
            "better": self.better,
            "gain": None if gain is None else vars(gain),
            "proven_by": self.setup.truth.name if self.tests else None,
            "candidates": self.candidates,
            "tests": self.tests,
            "channels": list(self.setup.channels),
            "noise_A": self.setup.noise,
            "sample_rate_hz": self.setup.sample_rate,
            "actuator": self.setup.actuator.name,
            "seed": self.seed,
            "version": VERSION,
        }

    def write_command(self, path: str | Path) -> None:
        """Write the command of the better test to a CSV file for `emaphm simulate --command`.

        An existing file is replaced; `OutputError` if the file cannot be written.
        """
        self.found.excitation.write(path, self.setup.sample_rate)

    def plot(self) -> "Figure":
        """Draw the commands and the half-widths of the given and the better test."""
        from emaphm.plotting.design import draw_design

        return draw_design(self)

    def __str__(self) -> str:
        """Return the excitations, a table of half-widths, and the notes."""
        coordinates = self.setup.actuator.coordinates
        tests = {"given": self.given} | ({"found": self.found} if self.better else {})
        lines = [f"{label}: {test.excitation.words(coordinates)}" for label, test in tests.items()]
        columns = []
        for label, test in tests.items():
            columns.append((f"{label}, predicted", test.predicted))
            if test.simulated is not None:
                columns.append((f"{label}, simulated", test.simulated.precision))
        rows = [(name, *(_width(precision, name) for _, precision in columns)) for name in NAMES]
        table = format_table(("95 % interval ±", *(label for label, _ in columns)), rows)
        return "\n".join([*lines, "", table, "", *self.notes()])

    def notes(self) -> list[str]:
        """Return the notes: the conditions of the table, the simulated tests, and the conclusion."""
        setup = self.setup
        conditions = (
            f"Medians over faults that fill their range; recorded: {', '.join(setup.channels)}; current "
            f"noise {setup.noise:.3g} A rms; {setup.sample_rate:g} Hz."
        )
        given, found = self.given.simulated, self.found.simulated
        if given is None or found is None:
            untested = "Not confirmed by simulated tests: none were asked for."
            return [conditions, *self._motion_note(), untested, self._conclusion()]
        wider = _wider(self.given.predicted, given.precision) | _wider(self.found.predicted, found.precision)
        too_wide = sorted(wider, key=NAMES.index)
        evidence = (
            f"{'Tested' if too_wide else 'Confirmed'} by diagnoses of {self.tests} tests simulated by the "
            f"{setup.truth.name} model; median error of the given manoeuvre {given.median_error:.2f} %"
        )
        evidence += f", of the better manoeuvre {found.median_error:.2f} %." if self.better else "."
        lines = [conditions, *self._motion_note(), evidence]
        if too_wide:
            lines.append(
                f"Not confirmed: {', '.join(too_wide)}, whose simulated intervals are more than {WIDER:g} "
                "times as wide as predicted. Use the simulated intervals; give more --tests if there are few."
            )
        if not setup.actuator.three_phases:
            lines.append(
                f"A drive of kind '{setup.actuator.drive_kind}' does not switch: the tests are simulated by "
                "the fitted model itself, so that no figure here includes its errors."
            )
        return [*lines, self._conclusion()]

    def _motion_note(self) -> list[str]:
        """Return a note if the given command is constant, so that only a position shows the motion."""
        lowest, highest = self.given.excitation.range
        if lowest < highest or "position_rad" in self.setup.channels:
            return []
        sentence = (
            "The given command is constant from its first row on: a diagnosis without the position detects "
            "no motion. Let it rest before the step, in a file with time_s and command_rad."
        )
        return [sentence]

    def _conclusion(self) -> str:
        """Return the conclusion: whether a better test was found, with standard errors."""
        if not self.candidates:
            return "No better manoeuvre was searched for."
        searched = f"{self.candidates} chirps within the limits"
        if self.gain is None:
            return f"Nothing better was found: none of {searched} has a higher predicted precision."
        widths = _change(self.gain.narrower, self.gain.narrower_error, "narrower", "wider")
        errors = _change(self.gain.nearer, self.gain.nearer_error, "smaller", "larger")
        if self.better:
            return f"Found among {searched}: intervals {widths}, errors {errors} (standard errors)."
        return (
            f"Nothing better was found: the best of {searched} has intervals {widths} and errors {errors} "
            f"(standard errors); intervals narrower by {SIGNIFICANT:g} standard errors, and no larger "
            "errors, would be better."
        )


def _wider(predicted: Precision, simulated: Precision) -> set[str]:
    """Return the components whose intervals in simulated tests are much wider than predicted."""
    return {
        name
        for name, width in predicted.half_widths.items()
        if predicted.identifies(name) and not simulated.half_widths.get(name, np.inf) <= WIDER * width
    }


def _change(logarithm: float, error: float, less: str, more: str) -> str:
    """Return a relative change in words; `logarithm` is that of the ratio of before to after."""
    ratio = float(np.exp(-logarithm))
    word = less if logarithm > 0 else more
    return f"{word} by {100 * abs(1 - ratio):.0f} ± {100 * ratio * error:.0f} %"


def _width(precision: Precision, name: str) -> str:
    if name not in precision.half_widths:
        return "not in this actuator"
    return f"{precision.half_widths[name]:.4f}" if precision.identifies(name) else "not identifiable"
