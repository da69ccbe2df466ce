"""Segments of a manoeuvre: they cover it once, begin at changes of direction, and grow."""

from itertools import pairwise

import numpy as np
import pytest

from emaphm.actuator import Chirp, Command, Ramp, Sine, Step
from emaphm.detection.segments import segments_of, strokes_of
from emaphm.detection.settings import DETECTOR


def test_a_trapezoid_has_an_up_stroke_a_hold_and_a_down_stroke() -> None:
    command = np.interp(np.arange(320), [0, 120, 200, 320], [0.0, 1.0, 1.0, 0.0])
    strokes = strokes_of(command, DETECTOR)
    assert [(one.first, one.stop, one.stroke) for one in strokes] == [
        (0, 120, "up-stroke"),
        (120, 200, "hold"),
        (200, 320, "down-stroke"),
    ]
    # 1/80 of 320 rows, four times as many, and the rest of the stroke.
    up = [one.stop - one.first for one in segments_of(command, DETECTOR) if one.stroke == "up-stroke"]
    assert up == [4, 16, 100]


@pytest.mark.parametrize("bits", [7, 9])
def test_counts_of_the_command_are_no_rests(bits: int) -> None:
    command = np.interp(np.arange(3200), [0, 400, 1400, 2000, 3000, 3200], [0.0, 0.0, 1.0, 1.0, 0.0, 0.0])
    counts = np.round(command * 2**bits) / 2**bits
    exact, shown = strokes_of(command, DETECTOR), strokes_of(counts, DETECTOR)
    assert [one.stroke for one in shown] == [one.stroke for one in exact]
    # A stroke begins at its first count, or half a first segment before.
    assert np.abs(np.subtract([one.first for one in shown], [one.first for one in exact])).max() <= 20


@pytest.mark.parametrize("command", [Chirp(), Sine(), Step(1e-3), Ramp(0.1)], ids=str)
@pytest.mark.parametrize("rows", [50, 333, 2500])
def test_segments_cover_every_row_once(command: Command, rows: int) -> None:
    segments = segments_of(command(np.arange(rows) * 0.5 / rows), DETECTOR)
    assert segments[0].first == 0
    assert segments[-1].stop == rows
    assert all(one.stop == other.first for one, other in pairwise(segments))
    assert all(one.stop - one.first >= DETECTOR.fewest_rows for one in segments[:-1])


def test_a_row_of_jitter_makes_no_stroke() -> None:
    command = np.linspace(0.0, 1.0, 200)
    command[100] = command[99] - 1e-3
    assert [one.stroke for one in strokes_of(command, DETECTOR)] == ["up-stroke"]
