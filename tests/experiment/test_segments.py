"""A flight cut into stretches: rests and small commands are refused with the reason, the rest identifies."""

import numpy as np
import pytest

from cases import THESIS
from emaphm.arrays import Array
from emaphm.diagnosis import diagnose
from emaphm.errors import MethodError
from emaphm.experiment import Segments, segments
from emaphm.recording import Recording, read_recording
from emaphm.simulated_recording import simulate

KEPT = ("time_s", "command_rad", "current_A", "voltage_V")
RATE = 1000.0


def flight(t: Array) -> Array:
    """Rest, a sine, rest, a motion hardly above the backlash, rest, a sweep, rest: 14 s."""
    command = np.zeros_like(t)
    for start, end, amplitude, hertz in ((2.0, 4.0, 5e-3, 3.0), (6.0, 7.0, 3e-5, 2.0)):
        on = (t >= start) & (t < end)
        command[on] = amplitude * np.sin(2 * np.pi * hertz * (t[on] - start))
    on = (t >= 10.0) & (t < 12.0)
    command[on] = 5e-3 * np.sin(2 * np.pi * 3.0 * (t[on] - 10.0) ** 2)
    return command


@pytest.fixture(scope="module")
def whole() -> Recording:
    made = simulate(THESIS, flight, duration=14.0, sample_rate=RATE, noise=0.05, adc_bits=12)
    return Recording({name: made[name] for name in KEPT}, source="flight")


@pytest.fixture(scope="module")
def cut(whole: Recording) -> Segments:
    return segments(whole, THESIS)


def test_the_stretches_are_the_whole_recording_in_order(whole: Recording, cut: Segments) -> None:
    edges = [one.rows for one in cut.stretches]
    assert edges[0][0] == 0
    assert edges[-1][1] == whole.samples
    assert all(before[1] == after[0] for before, after in zip(edges, edges[1:], strict=False))


def test_rests_are_refused_and_motions_are_not(cut: Segments) -> None:
    resting = [one for one in cut.stretches if one.reason.startswith("at rest")]
    assert [(round(one.start_s), round(one.end_s)) for one in resting][0] == (0, 2)
    assert sum(one.end_s - one.start_s for one in resting) == pytest.approx(14 - 5, abs=2.0)
    for start, end in ((2.0, 4.0), (10.0, 12.0)):
        inside = [one for one in cut.accepted if start - 0.3 <= one.start_s and one.end_s <= end + 0.6]
        assert inside
        assert all("friction" in one.identifies for one in inside)


def test_a_command_that_is_too_small_is_refused_with_what_would_be_known(cut: Segments) -> None:
    refused = [one for one in cut.stretches if 5.5 < one.start_s < 6.5]
    assert refused
    assert not any("friction" in one.identifies for one in refused)
    strict = [one for one in cut.stretches if "would be known to ±" in one.reason]
    assert strict or all("at rest" in one.reason for one in refused)


def test_what_is_promised_is_kept_by_a_diagnosis(cut: Segments) -> None:
    for one, part in list(zip(cut.accepted, cut.recordings(), strict=True))[1:3]:
        found = diagnose(part, THESIS, workers=1)
        for name in one.identifies:
            half = np.ptp(found.interval[name]) / 2
            # The prediction is of a healthy actuator and of the residual's order: within a factor of three.
            assert half < 3 * one.half_widths[name]


def test_a_longer_stretch_is_known_better(whole: Recording) -> None:
    fine = segments(whole, THESIS, wanted=0.003)
    sine = [one for one in fine.stretches if 1.5 < one.start_s < 4.0]
    coarse = [one for one in segments(whole, THESIS).stretches if 1.5 < one.start_s < 4.0]
    assert len(sine) < len(coarse)
    assert min(one.half_widths["friction"] for one in sine) < min(
        one.half_widths["friction"] for one in coarse
    )


def test_a_saturated_stretch_is_refused(whole: Recording) -> None:
    limit = THESIS.controller.current_limit
    columns = dict(whole.channels)
    current = columns["current_A"].copy()
    current[2000:4000] = limit * np.sign(current[2000:4000])
    reasons = [
        one.reason
        for one in segments(whole.with_channels({**columns, "current_A": current}), THESIS).stretches
        if 2.2 < one.start_s < 3.5
    ]
    assert reasons
    assert all("saturated: the current is at its limit in" in reason for reason in reasons)


def test_same_seed_same_stretches(whole: Recording, cut: Segments) -> None:
    assert segments(whole, THESIS, workers=1).to_dict() == cut.to_dict()


def test_the_stretches_are_written_as_recordings(cut: Segments, tmp_path) -> None:  # type: ignore[no-untyped-def]
    paths = cut.write(tmp_path / "cut")
    assert len(paths) == len(cut.accepted)
    for path, one in zip(paths, cut.recordings(), strict=True):
        np.testing.assert_array_equal(read_recording(path)["current_A"], one["current_A"])


@pytest.mark.parametrize(("more", "message"), [({"wanted": 0.0}, "precision"), ({"longest_s": -1.0}, "-1 s")])
def test_what_cannot_be_is_refused(whole: Recording, more: dict[str, float], message: str) -> None:
    with pytest.raises(MethodError, match=message):
        segments(whole, THESIS, **more)  # type: ignore[arg-type]


def test_a_recording_at_rest_throughout_is_one_refusal() -> None:
    ones = np.ones(400)
    still = Recording({"time_s": np.arange(400) * 1e-2, "command_rad": 1e-3 * ones, "current_A": ones})
    only = segments(still, THESIS).stretches
    assert [one.reason for one in only] == ["at rest: the command does not move the actuator"]
