"""Cycles that begin some rows apart are compared where their commands are the same."""

import numpy as np
import pytest

from emaphm.detection import Detector
from emaphm.detection.row_offset import row_offset
from emaphm.recording import Recording

from .rig import COMMAND, ROWS, Rig, runs

HEALTHY = Rig()


def rows(recording: Recording, first: int, stop: int = ROWS) -> Recording:
    return Recording({name: values[first:stop] for name, values in recording.channels.items()}, "instant")


@pytest.mark.parametrize("lost", [0, 1, 2, 3])
def test_rows_that_were_lost_are_counted(lost: int) -> None:
    for noise in (0.0, 1e-4):
        measured = COMMAND + noise * np.random.default_rng(lost).standard_normal(ROWS)
        assert row_offset(measured[lost:], COMMAND, 4) == lost
        assert row_offset(measured, COMMAND[lost:], 4) == -lost


def test_noise_is_no_offset() -> None:
    rng = np.random.default_rng(0)
    for command in (COMMAND, np.full(ROWS, 0.1)):
        for noise in (1e-18, 1e-4, 1e-2):
            one, other = command + noise * rng.standard_normal((2, 100, ROWS))
            assert [row_offset(a, b, 4) for a, b in zip(one, other, strict=True)] == [0] * 100


def test_healthy_cycles_that_begin_a_row_later_are_like_healthy() -> None:
    healthy, groups = runs(HEALTHY, 20, seed=0, cycles=3)
    detector = Detector.learn(healthy, groups=groups)
    later, _ = runs(HEALTHY, 40, seed=1)
    late = [detector.judge(rows(one, 1)) for one in later]
    # At 1 %, four or more of 40 have the probability 0.1 %.
    assert sum(not one.like_healthy for one in late) <= 3
    for one, whole in zip(late, map(detector.judge, later), strict=True):
        assert one.excess == pytest.approx(whole.excess, rel=0.2)


def test_a_response_a_row_late_on_the_same_command_is_not_like_healthy() -> None:
    healthy, groups = runs(HEALTHY, 20, seed=0, cycles=3)
    detector = Detector.learn(healthy, groups=groups)
    one = runs(HEALTHY, 1, seed=2)[0][0]
    position = np.roll(one["position_rad"], 1)
    position[0] = position[1]
    lags = Recording({**one.channels, "position_rad": position}, "instant")
    assert not detector.judge(lags).like_healthy


def test_one_healthy_cycle_without_its_first_row_hides_no_fault() -> None:
    healthy, groups = runs(HEALTHY, 20, seed=0, cycles=3)
    whole = Detector.learn(healthy, groups=groups)
    # A lag by half a row, which a scatter of one row among healthy cycles would hide.
    worn = []
    for one in runs(HEALTHY, 20, seed=3)[0]:
        position = one["position_rad"] - 0.5 * np.gradient(COMMAND)
        worn.append(Recording({**one.channels, "position_rad": position}, "instant"))
    for place in (0, 7):
        shortened = [*healthy[:place], rows(healthy[place], 1), *healthy[place + 1 :]]
        detector = Detector.learn(shortened, groups=groups)
        found = np.array([detector.judge(one).excess for one in worn])
        assert np.all(found > 1)
        assert np.median(found) > 0.8 * np.median([whole.judge(one).excess for one in worn])
