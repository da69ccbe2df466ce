"""Levels: the mean of a run is judged by the scatter of means of healthy runs with as many cycles."""

from collections.abc import Sequence

import numpy as np
import pytest

from emaphm.detection import Detector
from emaphm.errors import RecordingError
from emaphm.recording import Recording

from .rig import Rig, runs

HEALTHY = Rig(run_scatter=0.0)
STIFF_UP = Rig(extra_up=0.03, run_scatter=0.0)


def learned(lengths: Sequence[int], seed: int = 0) -> Detector:
    """Return a detector learned from runs of those numbers of cycles."""
    every, groups = runs(HEALTHY, len(lengths), seed, cycles=max(lengths))
    kept = [k for k in range(len(every)) if k % max(lengths) < lengths[groups[k]]]
    return Detector.learn([every[k] for k in kept], groups=[groups[k] for k in kept])


def detected(detector: Detector, cycles: int = 5) -> float:
    """Return the share of 40 stiff runs that the detector finds."""
    stiff, _ = runs(STIFF_UP, 40, seed=1, cycles=cycles)
    each = [stiff[k : k + cycles] for k in range(0, len(stiff), cycles)]
    return float(np.mean([not detector.judge(one).like_healthy for one in each]))


def numbers(detector: Detector) -> list[tuple[int, int]]:
    """Return the cycles of each level, and the runs it was learned from."""
    return [(one.cycles, one.runs) for one in detector.manoeuvres[0].levels]


def test_a_short_healthy_run_takes_no_sensitivity_from_the_others() -> None:
    even, uneven = learned([5] * 20), learned([5] * 7 + [1] + [5] * 12)
    assert numbers(even) == [(1, 20), (5, 20)]
    assert numbers(uneven) == [(1, 20), (5, 19)]
    # Of 40 runs, the share has a standard error of 0.08 at most.
    assert detected(uneven) == pytest.approx(detected(even), abs=0.1)
    assert detected(uneven) > detected(learned([1] * 20)) + 0.3


def test_a_level_needs_half_of_the_runs_and_twice_the_cycles_of_the_one_before() -> None:
    assert numbers(learned([2] * 3 + [3] * 6 + [4] * 9)) == [(1, 18), (2, 18), (4, 9)]
    assert numbers(learned([1] * 7 + [5] * 6)) == [(1, 13)]
    assert numbers(learned([1] * 6 + [5] * 7)) == [(1, 13), (5, 7)]
    assert numbers(learned([1] * 4 + [5] * 4)) == [(1, 8)]


def test_a_result_states_the_level_by_which_it_was_judged() -> None:
    detector = learned([5] * 10)
    five, _ = runs(HEALTHY, 1, seed=3, cycles=5)
    whole, part, single = detector.judge(five), detector.judge(five[:4]), detector.judge(five[0])
    assert [one.level_cycles for one in (whole, part, single)] == [5, 1, 1]
    assert "4 cycles by the scatter of single ones" in part.sentence
    assert "scatter of single ones" not in whole.sentence + single.sentence
    assert "false alarms, for means of 5 cycles or more." in str(whole)
    assert part.to_dict()["level_cycles"] == 1


def test_with_few_healthy_runs_a_run_with_alarms_in_all_cycles_is_detected() -> None:
    found, cycles_found, alarms = list[float](), list[float](), 0
    for seed in range(3):
        detector = learned([5] * 5, seed)
        stiff, _ = runs(Rig(extra_up=0.1, run_scatter=0.0), 10, seed=60 + seed, cycles=5)
        found += [not detector.judge(stiff[k : k + 5]).like_healthy for k in range(0, 50, 5)]
        cycles_found += [not detector.judge(one).like_healthy for one in stiff]
        healthy, _ = runs(HEALTHY, 30, seed=80 + seed, cycles=5)
        alarms += sum(not detector.judge(healthy[k : k + 5]).like_healthy for k in range(0, 150, 5))
    assert np.mean(cycles_found) > 0.95
    assert np.mean(found) > 0.9
    # At 1 %, five or more of 90 have the probability 0.2 %.
    assert alarms < 5


def test_cycles_that_contradict_their_run_are_counted() -> None:
    detector = learned([5] * 20)
    healthy, _ = runs(HEALTHY, 1, seed=7, cycles=4)
    odd, _ = runs(Rig(extra_up=0.12, run_scatter=0.0), 1, seed=8)
    result = detector.judge([*healthy, *odd])
    assert not detector.judge(odd).like_healthy
    assert (result.cycles_alarming, result.to_dict()["cycles_alarming"]) == (1, 1)
    assert result.like_healthy == ("1 of 5 cycles alarm" in result.sentence)
    assert detector.judge(healthy).cycles_alarming == 0


def copied(recording: Recording) -> Recording:
    return Recording(dict(recording.channels), "instant", "copy.csv")


def test_a_cycle_given_twice_is_refused() -> None:
    healthy, groups = runs(HEALTHY, 8, seed=4, cycles=2)
    message = r"copy\.csv: the same, row by row, as rig; give each cycle once"
    with pytest.raises(RecordingError, match=message):
        Detector.learn([*healthy, copied(healthy[3])], groups=[*groups, "again"])
    detector = Detector.learn(healthy, groups=groups)
    with pytest.raises(RecordingError, match=message):
        detector.judge([healthy[0], copied(healthy[0])])
