"""Segmentation of a long recording, of a flight or a day on the rig, into stretches that identify faults."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from emaphm.actuator import NAMES, Actuator
from emaphm.actuator.quantity import USER_ANGLE, unit_for
from emaphm.arrays import Array, runs
from emaphm.diagnosis.verdict import VERDICT, Z95
from emaphm.errors import MethodError
from emaphm.estimation.discrepancy import LONGEST_S
from emaphm.estimation.search_result import default_scatter
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.experiment.segmentation.cells import CELLS, Cells, block_information
from emaphm.experiment.segmentation.result import Segment, Segments
from emaphm.progress import Progress
from emaphm.recording import Recording
from emaphm.recording.checks import FEWEST_SAMPLES
from emaphm.recording.plausibility import MOST_ROWS, check_rate_and_current

IN_MOTION = "begins in motion: the states of backlash and controller are not known there"
"""Reason against a stretch that continues a movement after its longest stretch. Such recordings of a healthy
actuator were not explained, with position and speed or without."""


@dataclass(frozen=True)
class SegmentSettings:
    """Settings of saturated stretches; a stretch ends at a rest (`CellSettings`).

    A row is at the limit if its current is above `at_limit` of the current limit. A stretch is saturated if
    more than `most_at_limit` of its rows are at the limit: their current has no information on friction, gain
    or load.
    """

    at_limit: float = 0.98
    most_at_limit: float = 0.3


SEGMENT = SegmentSettings()


def segments(
    recording: Recording,
    actuator: Actuator,
    *,
    wanted: float = VERDICT.hidden_fault,
    longest_s: float = LONGEST_S,
    seed: int = 0,
    workers: int | None = None,
    on_progress: Progress | None = None,
) -> Segments:
    """Return the stretches of `recording`: those that will identify faults, and the others with a reason.

    The averaged model is driven with the recorded command; its derivatives at the healthy actuator give the
    information of each cell of a quarter of a second. A stretch is a movement from rest to rest, or its first
    `longest_s`. It is accepted if the expected half-width of at least one component is at most `wanted`.

    Parameters
    ----------
    recording
        A flight or a part of it, with its command; of any length.
    actuator
        The description of the unit.
    wanted
        Largest half-width of the 95 % interval of a component, in its unit, with which a stretch identifies
        it; the default is that of the verdict "healthy".
    longest_s
        Longest stretch [s]; the default is the longest recording that the reference model corrects.
    seed, workers
        The same seed gives the same bits, whatever the number of threads.
    on_progress
        Called with the fraction done, from 0 to 1.

    Raises
    ------
    MethodError
        `wanted` or `longest_s` is not above 0, or the model has nothing to compare with the recording.
    RecordingError
        A recorded supply is not positive, rows are too far apart for a diagnosis, a current is orders of
        magnitude beyond its limit, or only phase currents could be compared and the actuator has no
        electrical description.
    """
    if not 0 < wanted <= 1:
        raise MethodError(f"a precision of ±{wanted:g} is impossible; give more than 0, up to 1")
    if not 0 < longest_s < math.inf:
        raise MethodError(f"stretches of {longest_s:g} s are impossible; give a number above 0")
    check_rate_and_current(recording, actuator)
    cells = Cells.of(recording, actuator)
    shortest = max(cells.rows, FEWEST_SAMPLES) / recording.sample_rate_hz
    if longest_s < shortest:
        raise MethodError(
            f"stretches of {longest_s:g} s at most are too short for a diagnosis; give {shortest:g} s or more"
        )
    space = ParameterSpace.of(actuator)
    information: dict[int, Array] = {}
    for first, by_cell, space_of_block in block_information(recording, actuator, cells, seed, workers):
        space = space_of_block
        information.update({first + i: of_cell for i, of_cell in enumerate(by_cell)})
        if on_progress is not None:
            on_progress((first + len(by_cell)) / cells.moves.size)
    most_rows = min(int(longest_s * recording.sample_rate_hz), MOST_ROWS)
    cutter = _Cutter(recording, actuator, cells, information, space, wanted, max(most_rows, FEWEST_SAMPLES))
    return Segments(recording, actuator.name, tuple(cutter.stretches()), wanted, seed)


@dataclass(frozen=True, eq=False)
class _Cutter:
    """Division of a recording into stretches; `information` (d, d) by cell, of the moving cells."""

    recording: Recording
    actuator: Actuator
    cells: Cells
    information: dict[int, Array]
    space: ParameterSpace
    wanted: float
    most_rows: int

    def stretches(self) -> Iterator[Segment]:
        """Yield the stretches in order; together they cover the recording."""
        start = 0
        for first, last in self._movements():
            if (begin := int(self.cells.edges[first])) > start:
                yield self._rest(start, begin)
                start = begin
            for segment in self._cut(start, first, last):
                yield segment
                start = segment.rows[1]
        if start < self.recording.samples:
            yield self._rest(start, self.recording.samples)

    def _movements(self) -> Iterator[tuple[int, int]]:
        """Yield first and last cell (exclusive) of each movement between two rests."""
        fewest = -(-FEWEST_SAMPLES // self.cells.rows)
        reached = 0
        for begin, end in runs(self.cells.moves):
            # One cell is added, because an actuator may be slower than a healthy one.
            first = max(begin, reached)
            last = min(max(end + 1, first + fewest), self.cells.moves.size)
            if last > first:
                yield first, last
                reached = last

    def _cut(self, start: int, first: int, last: int) -> Iterator[Segment]:
        """Yield the stretches of a movement from row `start`, of the cells `first` to `last` (exclusive)."""
        total, edges = np.zeros((self.space.dimensions,) * 2), self.cells.edges.tolist()
        for cell in range(first, last):
            total = total + self.information.get(cell, 0.0)
            end = edges[cell + 1]
            if cell + 1 == last or edges[cell + 2] - start > self.most_rows:
                yield self._movement(start, end, self._half_widths(total), in_motion=start > edges[first])
                start, total = end, np.zeros_like(total)

    def _half_widths(self, information: Array) -> dict[str, float]:
        """Return the expected half-width of each component; for eccentricity, along its worst direction."""
        space = self.space
        prior = np.diag(space.prior_deviations**-2)
        values, axes = np.linalg.eigh((information + information.T) / 2)
        # The estimated information has no bias, and may therefore be negative by chance if there is none.
        positive = axes * np.maximum(values, 0.0) @ axes.T
        covariance = np.linalg.inv(positive + prior) + default_scatter(space.dimensions)
        halves = {}
        for column, i in enumerate(space.columns):
            variance = covariance[column, column]
            if NAMES[i] == "eccentricity":
                variance = np.linalg.eigvalsh(covariance[column : column + 2, column : column + 2])[-1]
            if NAMES[i] != "eccentricity_phase":
                halves[NAMES[i]] = Z95 * float(np.sqrt(variance))
        return halves

    def _movement(self, first: int, last: int, halves: dict[str, float], *, in_motion: bool) -> Segment:
        identifies = tuple(name for name, half in halves.items() if half <= self.wanted)
        reason = self._saturation(first, last)
        if not reason and last - first < FEWEST_SAMPLES:
            reason = f"too short: {last - first} rows, a recording has at least {FEWEST_SAMPLES}"
        if not reason and in_motion:
            reason = IN_MOTION
        if not reason and not identifies:
            best = min(halves, key=lambda name: halves[name])
            reason = f"command too small or too slow: {best} would be known to ±{halves[best]:.2g} only"
        return self._stretch(first, last, halves, () if reason else identifies, reason)

    def _saturation(self, first: int, last: int) -> str:
        """Return the reason against a saturated stretch; empty if the current is within its limit."""
        if "current_A" not in self.recording:
            return ""
        level = SEGMENT.at_limit * self.actuator.controller.current_limit
        share = float(np.mean(np.abs(self.recording["current_A"][first:last]) >= level))
        if share <= SEGMENT.most_at_limit:
            return ""
        return f"saturated: the current is at its limit in {100 * share:.0f} % of the rows"

    def _rest(self, first: int, last: int) -> Segment:
        least = f"{self.cells.least:.2g} {unit_for(USER_ANGLE, self.actuator.coordinates)}"
        reason = f"at rest: in {CELLS.rest_s:g} s the command moves by no more than {least}"
        return self._stretch(first, last, {}, (), reason)

    def _stretch(
        self, first: int, last: int, halves: dict[str, float], identifies: tuple[str, ...], reason: str
    ) -> Segment:
        time, interval = self.recording["time_s"], self.recording.interval_s
        end = float(time[last - 1]) + interval
        return Segment((first, last), float(time[first]), end, halves, identifies, reason)
