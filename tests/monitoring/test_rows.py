"""Rows of a stream: division into chunks, late and repeated rows, a clock that is set back, movements."""

import json
import math
import random
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emaphm.arrays import Array
from emaphm.monitoring.settings import StreamSettings
from emaphm.monitoring.stream.movements import Gathering, Movement
from emaphm.monitoring.stream.row_order import RowOrder
from emaphm.monitoring.stream.rows import Cells, RowParser

ROWS: list[Cells] = [{"time_s": i / 10, "unit": "S-1", "x": -1.5} for i in range(20)]
NDJSON = "".join(json.dumps(row) + "\n" for row in ROWS)
CSV = "time_s,unit,x\n" + "".join(f"{row['time_s']},S-1,-1.5\n" for row in ROWS)


def parsed(content: bytes, cuts: list[int]) -> tuple[list[Cells], RowParser]:
    parser = RowParser(1000)
    places = [0, *sorted(cuts), len(content)]
    rows = [row for a, b in pairwise(places) for row in parser.feed(content[a:b])]
    return [*rows, *parser.end()], parser


@pytest.mark.parametrize(
    "text", [NDJSON, CSV, CSV.replace("\n", "\r\n"), "\ufeff" + CSV, CSV + CSV.split("\n")[0] + "\n"]
)
@given(cuts=st.lists(st.integers(0, 300), max_size=8))
def test_parsed_rows_do_not_depend_on_the_division_of_the_stream_into_chunks(
    text: str, cuts: list[int]
) -> None:
    rows, parser = parsed(text.encode(), cuts)
    assert rows == ROWS
    assert not parser.skipped


def test_invalid_lines_are_counted() -> None:
    bad = '[1]\n{"time_s": \n' + "x" * 2000 + "\n" + "\n" + '{"time_s": null, "x": true, "y": [1]}\n'
    rows, parser = parsed((NDJSON + bad + NDJSON).encode(), [700, 1500])
    assert len(rows) == 41
    partial = rows[20]
    assert math.isnan(float(partial["time_s"]))
    assert math.isnan(float(partial["y"]))
    assert partial["x"] == 1.0
    assert sum(parser.skipped.values()) == 3
    rows, parser = parsed(b"time_s,x\n1,2\n3\n4,,\n5,\n6,7", [])
    assert rows[0] == {"time_s": 1.0, "x": 2.0}
    assert len(rows) == 2
    assert parser.skipped == {"another number of cells than the header": 2, "cut short at the end": 1}


def ordered(order: RowOrder, times: list[float]) -> list[float | None]:
    passed_rows = [row for time in times for row in order.push(time, {})]
    return [None if row is None else row[0] for row in [*passed_rows, *order.flush()]]


def test_late_rows_are_sorted_by_time() -> None:
    times = [float(i) for i in range(200)]
    random_numbers = random.Random(0)  # noqa: S311
    shuffled = sorted(times, key=lambda time: time + random_numbers.uniform(0, 8))
    order = RowOrder(8)
    assert ordered(order, shuffled) == times
    assert order.left_out == 0


def test_repeated_rows_and_rows_that_are_too_late_are_left_out() -> None:
    order = RowOrder(4)
    assert ordered(order, [*range(20), 3.0, *range(20, 30), 25.0, 29.0]) == list(range(30))
    assert order.left_out == 3


def test_a_clock_that_is_set_back_starts_a_new_sequence() -> None:
    order = RowOrder(4)
    assert ordered(order, [*range(100, 120), *range(10, 30)]) == [*range(100, 120), None, *range(10, 30)]


SETTINGS = StreamSettings()


def gathered(
    times: Array, command: Array, settings: StreamSettings = SETTINGS
) -> tuple[list[Movement], Gathering]:
    gathering = Gathering(settings)

    def add() -> Iterator[Movement]:
        for time, value in zip(times.tolist(), command.tolist(), strict=True):
            yield from gathering.add(time, value, {"time_s": time, "command_rad": value})
        yield from gathering.end()

    return list(add()), gathering


def test_movements_are_separated_at_rests() -> None:
    times = np.arange(0, 40, 0.01)
    moving = (times % 10 > 3) & (times % 10 < 5)
    command = np.where(moving, np.sin(20 * times), 0.0)
    movements, gathering = gathered(times, command)
    assert len(movements) == 4
    for number, movement in enumerate(movements):
        assert movement.first < 10 * number + 3
        assert movement.last == pytest.approx(10 * number + 6.0, abs=0.1)
        assert movement.columns.numeric["time_s"].tolist() == pytest.approx(
            np.arange(movement.first, movement.last + 0.005, 0.01).tolist()
        )
    assert gathering.skipped == 0


@pytest.mark.parametrize("wild", [60.0, -1e6])
def test_an_outlier_of_the_command_does_not_hide_the_following_movements(wild: float) -> None:
    times = np.arange(0, 40, 0.01)
    moving = (times % 10 > 3) & (times % 10 < 5)
    command = np.where(moving, 0.005 * np.sin(20 * times), 0.0)
    ends = [movement.last for movement in gathered(times, command)[0]]
    command[800] = wild  # a single moving row in the rest after the first movement
    movements, gathering = gathered(times, command)
    assert [movement.last for movement in movements] == pytest.approx(sorted([*ends, 9.01]))
    assert gathering.skipped == 0


def test_rows_after_judged_ones_are_skipped_up_to_the_next_rest_only_within_a_motion() -> None:
    times = np.arange(0, 20, 0.01)
    moving = (times % 10 > 3) & (times % 10 < 5)
    command = np.where(moving, np.sin(20 * times), 0.0)
    for until, skipped_until, expected in ((4.0, 6.0, [16.0]), (6.5, 6.5, [16.0]), (13.0, 13.0, [16.0])):
        gathering, movements = Gathering(SETTINGS), []
        for time, value in zip(times.tolist(), command.tolist(), strict=True):
            if time < until:
                gathering.pass_over(time, value)
            else:
                movements += list(gathering.add(time, value, {"time_s": time}))
        assert [movement.last for movement in movements] == pytest.approx(expected, abs=0.05), until
        assert 0.01 * gathering.skipped == pytest.approx(skipped_until - until, abs=0.05), until


def test_a_movement_beyond_the_longest_duration_is_cut_and_skipped_up_to_the_next_rest() -> None:
    settings = StreamSettings(longest_s=5.0)
    times = np.arange(0, 57, 0.01)
    command = np.where(times < 50, np.sin(20 * times), np.where(times < 55, 0.0, np.sin(20 * times)))
    movements, gathering = gathered(times, command, settings)
    assert [round(movement.last - movement.first, 1) for movement in movements] == [
        5.0,
        pytest.approx(3.5, abs=1.0),
    ]
    assert movements[1].first > 50
    assert gathering.skipped * 0.01 == pytest.approx(46, abs=0.2)


def test_a_resting_stream_uses_bounded_memory() -> None:
    gathering = Gathering(StreamSettings())
    most = 0
    for i in range(100_000):
        assert not list(gathering.add(i * 0.01, 1.0, {"time_s": i * 0.01, "command_rad": 1.0}))
        most = max(most, len(gathering._times))
    assert most <= 202


def test_rows_of_a_movement_are_skipped_after_a_short_gap_and_used_after_a_long_gap() -> None:
    times = np.arange(0, 20, 0.01)
    command = np.sin(20 * times)
    short = (times < 5) | (times > 5.5)
    movements, gathering = gathered(times[short], command[short])
    assert [round(movement.last) for movement in movements] == [5]
    assert gathering.skipped > 1400
    long = (times < 5) | (times > 7.5)
    movements, gathering = gathered(times[long], command[long])
    assert [round(movement.last) for movement in movements] == [5, 20]
    assert gathering.skipped == 0
