"""Segmentation of a flight: rests and small commands are refused with a reason, other stretches accepted."""

import itertools
from pathlib import Path

import numpy as np
import pytest

from cases import THESIS, USUAL
from emaphm.actuator import Chirp, Ramp
from emaphm.arrays import Array
from emaphm.diagnosis import diagnose
from emaphm.errors import MethodError, OutputError, RecordingError
from emaphm.experiment import Segments, segments
from emaphm.experiment.segmentation.healthy_motion import healthy_position
from emaphm.experiment.segmentation.segments import IN_MOTION
from emaphm.recording import Recording, read_recording
from emaphm.simulated_recording import simulate

KEPT = ("time_s", "command_rad", "current_A", "voltage_V")
RATE = 1000.0


def flight(t: Array) -> Array:
    """Rest, a sine, rest, a motion hardly above the backlash, rest, a sweep, rest: 10 s."""
    command = np.zeros_like(t)
    for start, end, amplitude, hertz in ((1.0, 2.0, 5e-3, 3.0), (4.0, 5.0, 3e-5, 2.0)):
        on = (t >= start) & (t < end)
        command[on] = amplitude * np.sin(2 * np.pi * hertz * (t[on] - start))
    on = (t >= 7.0) & (t < 9.0)
    command[on] = 5e-3 * np.sin(2 * np.pi * 3.0 * (t[on] - 7.0) ** 2)
    return command


@pytest.fixture(scope="module")
def flight_recording() -> Recording:
    recording = simulate(THESIS, flight, duration=10.0, sample_rate=RATE, noise=0.05, adc_bits=12)
    return Recording({name: recording[name] for name in KEPT}, source="flight")


@pytest.fixture(scope="module")
def cut(flight_recording: Recording) -> Segments:
    return segments(flight_recording, THESIS)


def test_the_stretches_cover_the_recording_in_order(flight_recording: Recording, cut: Segments) -> None:
    edges = [stretch.rows for stretch in cut.stretches]
    assert edges[0][0] == 0
    assert edges[-1][1] == flight_recording.samples
    assert all(before[1] == after[0] for before, after in itertools.pairwise(edges))


def test_rests_are_refused_and_motions_are_not(cut: Segments) -> None:
    resting = [stretch for stretch in cut.stretches if stretch.reason.startswith("at rest")]
    assert (round(resting[0].start_s), round(resting[0].end_s)) == (0, 1)
    assert sum(stretch.end_s - stretch.start_s for stretch in resting) == pytest.approx(10 - 4, abs=1.5)
    for start, end in ((1.0, 2.0), (7.0, 9.0)):
        inside = [
            stretch
            for stretch in cut.accepted
            if start - 0.3 <= stretch.start_s and stretch.end_s <= end + 0.6
        ]
        assert inside
        assert all("friction" in stretch.identifies for stretch in inside)


def test_a_command_that_is_too_small_is_refused_with_the_best_precision(flight_recording: Recording) -> None:
    strict = segments(flight_recording, THESIS, wanted=1e-3).stretches
    refused = [stretch for stretch in strict if 3.5 < stretch.start_s < 4.5]
    assert refused
    assert all("command too small or too slow: " in stretch.reason for stretch in refused)
    assert "would be known to ±" in refused[0].reason


def test_the_expected_precision_of_a_stretch_from_rest_is_that_of_a_diagnosis() -> None:
    # Shorter than the flight: a diagnosis takes its time by the row.
    def brief(t: Array) -> Array:
        return np.where((t >= 0.3) & (t < 0.7), 5e-3 * np.sin(2 * np.pi * 5.0 * (t - 0.3)), 0.0)

    recording = simulate(THESIS, brief, duration=0.9, sample_rate=RATE, noise=0.05, adc_bits=12)
    cut = segments(Recording({name: recording[name] for name in KEPT}), THESIS)
    first = cut.accepted[0]
    assert {"friction", "gain"} <= set(first.identifies)
    diagnosis = diagnose(cut.recordings()[0], THESIS, nuisances=USUAL, workers=1)
    assert diagnosis.explained
    for name in first.identifies:
        # The prediction is cautious, of a healthy actuator, and its derivatives have errors.
        assert np.ptp(diagnosis.interval[name]) / 2 < 2 * first.half_widths[name]


def test_a_stretch_that_begins_in_motion_is_refused(flight_recording: Recording, cut: Segments) -> None:
    assert sum(0.5 < stretch.start_s < 2.0 for stretch in cut.stretches) == 1
    short = [
        stretch
        for stretch in segments(flight_recording, THESIS, longest_s=0.5).stretches
        if 0.5 < stretch.start_s < 2.0
    ]
    assert len(short) > 1
    assert [stretch.reason == IN_MOTION for stretch in short] == [False] + [True] * (len(short) - 1)


def test_a_saturated_stretch_is_refused(flight_recording: Recording) -> None:
    limit = THESIS.controller.current_limit
    current = flight_recording["current_A"].copy()
    current[1000:2000] = limit * np.sign(current[1000:2000])
    saturated = flight_recording.with_channels({**flight_recording.channels, "current_A": current})
    reasons = [
        stretch.reason for stretch in segments(saturated, THESIS).stretches if 0.5 < stretch.start_s < 1.5
    ]
    assert reasons
    assert all("saturated: the current is at its limit in" in reason for reason in reasons)


def test_a_current_in_milliamperes_is_not_called_saturated(flight_recording: Recording) -> None:
    in_mA = flight_recording.with_channels(
        {**flight_recording.channels, "current_A": 1e3 * flight_recording["current_A"]}
    )
    with pytest.raises(RecordingError, match="seems to be in milliamperes"):
        segments(in_mA, THESIS)


def test_times_in_milliseconds_are_refused_as_by_a_diagnosis(flight_recording: Recording) -> None:
    wrong = flight_recording.with_channels(
        {**flight_recording.channels, "time_s": 1e3 * flight_recording["time_s"]}
    )
    with pytest.raises(RecordingError, match="if time_s is in milliseconds convert it"):
        segments(wrong, THESIS)


def test_the_same_seed_has_the_same_stretches(flight_recording: Recording, cut: Segments) -> None:
    assert segments(flight_recording, THESIS, workers=1).to_dict() == cut.to_dict()


def test_the_stretches_are_written_as_recordings(cut: Segments, tmp_path: Path) -> None:
    paths = cut.write(tmp_path / "cut")
    assert len(paths) == len(cut.accepted)
    for path, stretch in zip(paths, cut.recordings(), strict=True):
        np.testing.assert_array_equal(read_recording(path, THESIS)["current_A"], stretch["current_A"])


def test_stretches_of_an_earlier_run_are_removed(cut: Segments, tmp_path: Path) -> None:
    names = [f"stretch_{number:03d}.csv" for number in range(1, len(cut.accepted) + 1)]
    for name in ("stretch_001.csv", "stretch_041.csv", "stretch_notes.csv"):
        (tmp_path / name).write_text("earlier")
    with pytest.raises(OutputError, match="exists already"):
        cut.write(tmp_path)
    assert {path.read_text() for path in tmp_path.iterdir()} == {"earlier"}
    cut.write(tmp_path, force=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == [*names, "stretch_notes.csv"]


@pytest.mark.parametrize(("more", "message"), [({"wanted": 0.0}, "precision"), ({"longest_s": -1.0}, "-1 s")])
def test_impossible_arguments_are_refused(
    flight_recording: Recording, more: dict[str, float], message: str
) -> None:
    with pytest.raises(MethodError, match=message):
        segments(flight_recording, THESIS, **more)  # type: ignore[arg-type]


def test_a_recording_entirely_at_rest_is_one_refused_stretch() -> None:
    ones = np.ones(400)
    still = Recording({"time_s": np.arange(400) * 1e-2, "command_rad": 1e-3 * ones, "current_A": ones})
    only = segments(still, THESIS).stretches
    # The backlash of 5 mrad behind the gear of 1/500.
    assert [stretch.reason for stretch in only] == [
        "at rest: in 1 s the command moves by no more than 1e-05 rad"
    ]


@pytest.mark.parametrize("rows", [200, 450, 499, 600])
def test_motion_at_the_end_is_not_called_a_rest(flight_recording: Recording, rows: int) -> None:
    sweep = {name: values[7000 : 7000 + rows] for name, values in flight_recording.channels.items()}
    sweep["time_s"] = sweep["time_s"] - sweep["time_s"][0]
    cut = segments(Recording(sweep, source="sweep"), THESIS)
    assert not any(stretch.reason.startswith("at rest") for stretch in cut.stretches)
    assert cut.stretches[-1].rows[1] == rows


@pytest.mark.parametrize(("rate", "rows"), [(10.0, 403), (10.0, 60)])
def test_motion_to_the_end_is_split_into_stretches_of_the_requested_length(rate: float, rows: int) -> None:
    t = np.arange(rows) / rate
    command = 5e-3 * np.sin(2 * np.pi * 0.5 * t)
    moving = Recording({"time_s": t, "command_rad": command, "current_A": np.cos(t)})
    cut = segments(moving, THESIS, longest_s=8.0, workers=1).stretches
    assert not any(stretch.reason.startswith("at rest") for stretch in cut)
    assert cut[-1].rows[1] == rows
    assert max(stretch.end_s - stretch.start_s for stretch in cut) <= 8.0 + 1e-9


@pytest.mark.parametrize(("row", "before"), [(1000, 0.0), (2000, 0.05), (1001, 0.0), (2249, 0.05)])
def test_a_step_is_found_at_any_row(row: int, before: float) -> None:
    def step(t: Array) -> Array:
        return np.where(t >= row / RATE, 0.05 - before, before * np.minimum(t / 0.1, 1.0))

    simulated = simulate(THESIS, step, model="averaged", duration=3.5, sample_rate=RATE)
    recording = Recording({name: simulated[name] for name in KEPT})
    around = [
        stretch
        for stretch in segments(recording, THESIS).stretches
        if stretch.rows[0] < row < stretch.rows[1]
    ]
    assert len(around) == 1
    assert "gain" in around[0].identifies
    # It begins before the step and lasts until the motion has ended, which takes 0.2 s.
    assert around[0].rows[1] > row + 200
    assert np.ptp(simulated["position_rad"][around[0].rows[1] :]) < 1e-6


def test_no_stretch_begins_or_ends_while_a_slow_actuator_moves() -> None:
    # A tenth of the thesis's speed limit: 0.5 rad take 3 s. A chirp is commanded meanwhile.
    slow = THESIS.model_copy(
        update={"controller": THESIS.controller.model_copy(update={"speed_limit": 83.8})}
    )
    chirp = Chirp(5e-3, 0.0, 10.0, 0.5)

    def command(t: Array) -> Array:
        return np.where(t >= 2.1, 0.5, 0.0) + np.where((t >= 3.5) & (t < 4.0), chirp(t - 3.5), 0.0)

    simulated = simulate(slow, command, model="averaged", duration=8.0, sample_rate=500.0)
    recording = Recording({name: simulated[name] for name in KEPT})
    cut = segments(recording, slow)
    assert len(cut.accepted) == 1
    for stretch in cut.stretches:
        for edge in stretch.rows:
            assert np.ptp(simulated["position_rad"][max(edge - 25, 0) : edge + 25]) < 1e-5


@pytest.mark.parametrize("noise", [0.0, 2e-6])
def test_a_small_motion_is_found_in_a_recording_of_a_large_one(noise: float) -> None:
    small = Chirp(3.5e-4, 0.0, 10.0, 2.0)

    def command(t: Array) -> Array:
        large = np.where((t >= 1.5) & (t < 2.5), 0.4 * np.sin(2 * np.pi * (t - 1.5)), 0.0)
        return large + np.where((t >= 6.0) & (t < 8.0), small(t - 6.0), 0.0)

    simulated = simulate(THESIS, command, model="averaged", duration=10.0, sample_rate=250.0)
    noisy = simulated["command_rad"] + noise * np.random.default_rng(0).normal(size=simulated.samples)
    recording = Recording({name: simulated[name] for name in KEPT} | {"command_rad": noisy})
    cut = segments(recording, THESIS)
    around = [stretch for stretch in cut.stretches if stretch.start_s < 7.0 < stretch.end_s]
    assert around[0].start_s == pytest.approx(6.0, abs=0.3)
    assert around[0].end_s == pytest.approx(8.0, abs=0.6)
    assert {"friction", "gain"} <= set(around[0].identifies)


def test_the_healthy_motion_simulated_in_pieces_equals_that_of_one_run() -> None:
    # Pieces of 20 s end in motion, in motion, and at rest; one at rest is not simulated.
    def command(t: Array) -> Array:
        slow = np.where(t < 50.0, 5e-3 * np.sin(2 * np.pi * 0.23 * t), 2e-3)
        return np.where(t < 85.0, slow, -1e-3)

    simulated = simulate(THESIS, command, model="averaged", duration=90.0, sample_rate=100.0)
    recording = Recording({name: simulated[name] for name in KEPT})
    position = healthy_position(recording, THESIS)
    # The user lags by half a gap of 1e-5 rad; each piece begins with the gap centred.
    np.testing.assert_allclose(position[:-1], simulated["position_rad"][:-1], atol=2e-5)


def test_a_slow_ramp_is_no_rest() -> None:
    # 0.98 of the backlash in a quarter of a second, 39 times the backlash in all.
    simulated = simulate(THESIS, Ramp(3.9e-5, 2.0), model="averaged", duration=12.0, sample_rate=100.0)
    cut = segments(Recording({name: simulated[name] for name in KEPT}), THESIS)
    assert cut.stretches[0].end_s == pytest.approx(2.0, abs=0.5)
    resting = sum(
        stretch.end_s - stretch.start_s for stretch in cut.stretches if stretch.reason.startswith("at rest")
    )
    assert resting == pytest.approx(2.0, abs=0.6)
