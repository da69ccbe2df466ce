"""Segments of a manoeuvre: strokes of the command, divided more finely at their beginning."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from emaphm.arrays import Array
from emaphm.detection.settings import DetectorSettings
from emaphm.recording.sensor_checks.resolution import runs_of_equal

AT_REST = 0.01
"""Rate of the command, relative to its largest rate, below which the command holds."""

LONGEST_COUNT = 1.05
"""Mean number of rows with equal values in a moving command above which it counts as coarsely resolved."""

STROKES = {1: "up-stroke", -1: "down-stroke", 0: "hold"}


@dataclass(frozen=True)
class StrokeSegment:
    """Rows `first` to `stop` (exclusive) of a manoeuvre, on a stroke of the kind `stroke` (`STROKES`)."""

    first: int
    stop: int
    stroke: str

    @property
    def rows(self) -> slice:
        """The rows as a slice."""
        return slice(self.first, self.stop)

    def label(self, interval_s: float) -> str:
        """Return the name of the segment: the stroke, and its first and last time [s]."""
        return f"{self.stroke}, {self.first * interval_s:.3g} to {self.stop * interval_s:.3g} s"


def segments_of(command: Array, settings: DetectorSettings) -> tuple[StrokeSegment, ...]:
    """Return the segments of a manoeuvre.

    During a stroke, the command moves in one direction or holds. The first segment of a stroke has the share
    `first_segment` of the manoeuvre, each further one is `growth` times as long as the one before; the last
    segment has the remaining rows. A stroke that is shorter than the first segment is joined to the stroke
    before.

    Parameters
    ----------
    command
        Command (n,) [rad or m].
    """
    first = _first_length(command.size, settings)
    segments: list[StrokeSegment] = []
    for stroke in strokes_of(command, settings):
        edges = [stroke.first]
        length = first
        while stroke.stop - edges[-1] >= 2 * length:
            edges.append(edges[-1] + length)
            length *= settings.growth
        edges.append(stroke.stop)
        segments += [StrokeSegment(a, b, stroke.stroke) for a, b in pairwise(edges)]
    return tuple(segments)


def strokes_of(command: Array, settings: DetectorSettings) -> tuple[StrokeSegment, ...]:
    """Return the strokes of a manoeuvre, each as one segment; `command` as in `segments_of`."""
    fewest = _first_length(command.size, settings)
    rate = _rate(command, fewest)
    direction = np.sign(rate) * (np.abs(rate) > AT_REST * np.max(np.abs(rate)))
    edges = [0, *(np.flatnonzero(np.diff(direction)) + 1).tolist(), command.size]
    strokes: list[tuple[int, int, int]] = []
    for start, stop in pairwise(edges):
        sign = int(direction[start])
        same = bool(strokes) and strokes[-1][2] == sign
        if strokes and (stop - start < fewest or same):
            strokes[-1] = (strokes[-1][0], stop, strokes[-1][2])
        else:
            strokes.append((start, stop, sign))
    if len(strokes) > 1 and strokes[0][1] < fewest:
        strokes[:2] = [(0, strokes[1][1], strokes[1][2])]
    return tuple(StrokeSegment(start, stop, STROKES[sign]) for start, stop, sign in strokes)


def _rate(command: Array, fewest: int) -> Array:
    """Return the change of `command` (n,) per row, (n,).

    If the command is recorded in coarse counts, and changes by less than a count per row, the change over
    `fewest` rows is returned: from row to row, it would seem to rest between two counts.
    """
    _, lengths = runs_of_equal(command)
    short = lengths[lengths < fewest]
    if short.size and short.mean() > LONGEST_COUNT:
        padded = np.pad(command, (fewest // 2, fewest - fewest // 2), mode="edge")
        return np.asarray(padded[fewest:] - padded[:-fewest])
    rate = np.diff(command, append=command[-1])
    rate[-1] = rate[-2]
    return rate


def _first_length(rows: int, settings: DetectorSettings) -> int:
    return max(settings.fewest_rows, round(settings.first_segment * rows))
