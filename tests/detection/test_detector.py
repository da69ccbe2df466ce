"""The detector: rate of false alarms, detection of faults with their place, files and refused recordings."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from emaphm.detection import DETECTOR, Detector, judged_left_out
from emaphm.detection.drift import drift_by_chance
from emaphm.errors import MethodError, RecordingError
from emaphm.recording import Recording

from .rig import Rig, runs

HEALTHY = Rig()
WORN = Rig(friction=0.9)
STIFF_UP = Rig(extra_up=0.12)


@pytest.fixture(scope="module")
def detector() -> Detector:
    recordings, groups = runs(HEALTHY, 20, seed=0, cycles=3)
    return Detector.learn(recordings, groups=groups)


@pytest.mark.parametrize("detectors", [5, pytest.param(20, marks=pytest.mark.evidence)])
def test_the_rate_of_false_alarms_is_the_stated_one(detectors: int) -> None:
    alarms = 0
    for seed in range(detectors):
        recordings, _ = runs(HEALTHY, 20, seed=seed)
        known = Detector.learn(recordings, settings=replace(DETECTOR, false_alarm_rate=0.05))
        later, _ = runs(HEALTHY, 60, seed=1000 + seed)
        alarms += sum(not known.judge(one).like_healthy for one in later)
    # 5 % expected, 3 of them in 60; within three standard deviations of the binomial.
    expected = 3 * detectors
    assert abs(alarms - expected) < 3 * (0.95 * expected) ** 0.5


def test_a_fault_is_detected_with_its_place(detector: Detector) -> None:
    recordings, _ = runs(STIFF_UP, 1, seed=5, cycles=3)
    result = detector.judge(recordings)
    assert not result.like_healthy
    assert "mostly current on the up-stroke" in result.sentence
    assert result.by_channel["current_A"] > 0.5
    assert sum(result.by_channel.values()) == pytest.approx(1)
    assert sum(one.t2 for one in result.contributions) == pytest.approx(result.t2)
    assert sum(one.q for one in result.contributions) == pytest.approx(result.q)


def test_a_healthy_run_is_like_healthy(detector: Detector) -> None:
    recordings, _ = runs(HEALTHY, 1, seed=6, cycles=3)
    assert detector.judge(recordings).like_healthy
    assert all(detector.judge(one).like_healthy for one in recordings)


def with_channel(recording: Recording, name: str, factor: float) -> Recording:
    channels = {one: recording[one] for one in recording}
    return Recording(channels | {name: factor * recording[name]})


@pytest.mark.parametrize("factor", [1e3, 1e-3])
def test_a_current_in_another_unit_is_no_fault(detector: Detector, factor: float) -> None:
    recordings, _ = runs(HEALTHY, 1, seed=6, cycles=3)
    other = [with_channel(one, "current_A", factor) for one in recordings]
    for given in (other, other[0]):
        with pytest.raises(RecordingError, match=r"current_A .*thousand.* times as large; convert"):
            detector.judge(given)
    # Ten times as much may be a jam.
    assert not detector.judge(runs(Rig(friction=10.0), 1, seed=7)[0][0]).like_healthy


def test_an_angle_in_degrees_is_no_fault(detector: Detector) -> None:
    one = runs(HEALTHY, 1, seed=6)[0][0]
    with pytest.raises(RecordingError, match=r"position_rad .* degrees: it is 57\.3"):
        detector.judge(with_channel(one, "position_rad", 180 / math.pi))


def test_a_channel_without_variation_is_not_evaluated() -> None:
    healthy, _ = runs(HEALTHY, 12, seed=0)
    noisy = [one["current_A"] for one in healthy]
    kept = ("time_s", "command_rad", "load_Nm", "position_rad")
    first = {name: healthy[0][name] for name in kept if name in healthy[0]}
    alike = [Recording(first | {"current_A": current}) for current in noisy]
    known = Detector.learn(alike)
    assert known.channels == ("current_A",)
    slightly_off = Recording(first | {"current_A": noisy[0], "position_rad": 1.001 * first["position_rad"]})
    assert known.judge(slightly_off).t2 < 2 * known.judge(alike[0]).t2_threshold
    with pytest.raises(RecordingError, match="are the same, row by row; give independent runs"):
        Detector.learn([alike[0]] * 12)


def test_the_mean_of_a_run_is_more_sensitive_than_a_cycle() -> None:
    single, together = [], []
    for seed in range(4):
        healthy, groups = runs(HEALTHY, 20, seed=seed, cycles=3)
        known = Detector.learn(healthy, groups=groups)
        stiff, _ = runs(Rig(extra_up=0.08), 30, seed=70 + seed, cycles=3)
        single += [not known.judge(one).like_healthy for one in stiff]
        together += [not known.judge(stiff[k : k + 3]).like_healthy for k in range(0, 90, 3)]
    # Shares of 360 and 120, standard errors 0.03 and 0.05.
    assert np.mean(together) > np.mean(single) + 0.1


def test_the_bound_on_the_rate_is_stated() -> None:
    recordings, _ = runs(HEALTHY, 15, seed=8)
    result = Detector.learn(recordings).judge(recordings[0])
    assert "at most 1 % cannot be shown with fewer than 299 runs" in result.shown
    assert "of 15 healthy runs left out" in result.shown


def test_healthy_runs_that_drift_are_named() -> None:
    steady, groups = runs(HEALTHY, 10, seed=30, cycles=3)
    wearing_in = [Rig(friction=0.8 - 0.02 * k, run_scatter=0.0) for k in range(10)]
    drifting = [runs(rig, 1, seed=40 + k, cycles=3, load=-100.0)[0] for k, rig in enumerate(wearing_in)]
    known = Detector.learn(
        [*steady, *(one for run in drifting for one in run)],
        groups=[*groups, *(100 + k for k in range(10) for _ in range(3))],
    )
    assert [known.manoeuvres[0].loads[place].name for place in known.manoeuvres[0].drifting] == ["load -100"]
    assert "load -100 drift in their order" in known.judge(drifting[0]).shown
    assert "drift" not in known.judge(steady[0]).shown


def test_the_probability_of_a_drift_is_the_share_of_orders_that_are_as_steady() -> None:
    # Of n! orders, one rises throughout and one falls.
    for count in (4, 5, 6, 7):
        assert drift_by_chance(np.arange(float(count))) == pytest.approx(2 / math.factorial(count))
    # None of 10,000 random orders is as steady: the probability is 1 in 10,001.
    assert drift_by_chance(np.arange(20.0)) == pytest.approx(1 / 10_001)


def test_cycles_taken_for_runs_show_no_rate() -> None:
    cycles, groups = runs(Rig(run_scatter=0.1), 5, seed=3, cycles=5)
    taken_for_runs, grouped = Detector.learn(cycles), Detector.learn(cycles, groups=groups)
    single = taken_for_runs.manoeuvres[0].levels[0]
    assert single.independent < 25
    assert "each resembles the run before it" in str(taken_for_runs)
    assert "with 95 % confidence" not in str(taken_for_runs)
    assert taken_for_runs.to_dict()["manoeuvres"][0]["levels"][0]["shown_rate"] is None
    assert "at most 45 % of false alarms are shown" in str(grouped)  # 0 of 5: 1 - 0.05^(1/5)


@pytest.mark.parametrize(("rigs", "most"), [(10, 1), pytest.param(60, 3, marks=pytest.mark.evidence)])
def test_steady_rigs_seldom_seem_to_drift_or_their_runs_to_resemble_each_other(rigs: int, most: int) -> None:
    found = [Detector.learn(runs(HEALTHY, 25, seed=seed)[0]).manoeuvres[0] for seed in range(rigs)]
    # At 1 %, more have the probability 0.4 % of 10, and 0.3 % of 60.
    assert sum(bool(one.drifting) for one in found) <= most
    assert sum(one.levels[0].independent < 25 for one in found) <= most


def test_the_nearest_seeded_fault_is_named(detector: Detector) -> None:
    examples = {
        "friction": runs(WORN, 4, seed=9)[0],
        "guide": runs(STIFF_UP, 4, seed=10)[0],
    }
    taught = detector.with_seeded(examples)
    for rig, name in ((WORN, "friction"), (STIFF_UP, "guide")):
        nearest = taught.judge(runs(rig, 1, seed=11, cycles=3)[0]).nearest
        assert nearest is not None
        assert (nearest.fault, nearest.alike) == (name, True)
    # A deviation in the opposite direction is like none of the seeded faults.
    opposite = taught.judge(runs(Rig(friction=0.7), 1, seed=12, cycles=3)[0])
    assert opposite.nearest is not None
    assert not opposite.nearest.alike
    assert "like none of the seeded faults" in opposite.sentence


def test_left_out_runs_are_judged_by_the_other_runs() -> None:
    recordings, groups = runs(HEALTHY, 8, seed=13, cycles=2)
    # The deviation of one run is large: only a detector that has not learned from it detects this.
    odd, _ = runs(Rig(friction=1.6), 1, seed=14, cycles=2)
    judged = {one.group: one for one in judged_left_out([*recordings, *odd], [*groups, "odd", "odd"])}
    assert len(judged) == 9
    assert not judged["odd"].run.like_healthy
    assert len(judged["odd"].cycles) == 2


def test_too_few_runs_to_leave_one_out_are_reported_with_their_number() -> None:
    recordings, _ = runs(HEALTHY, 5, seed=27)
    with pytest.raises(
        RecordingError, match=r"4 healthy runs .*counted without the run of .*, which is left out"
    ):
        list(judged_left_out(recordings, "abcde"))
    with pytest.raises(RecordingError, match="all 5 recordings are of one run; give further runs"):
        list(judged_left_out(recordings, "aaaaa"))
    with pytest.raises(MethodError, match="2 groups for 5 recordings"):
        list(judged_left_out(recordings, "ab"))


@pytest.mark.parametrize("rate", [1e-15, 1 - 1e-15])
def test_a_rate_without_a_threshold_is_refused(rate: float) -> None:
    recordings, _ = runs(HEALTHY, 5, seed=28)
    with pytest.raises(MethodError, match="has no threshold with"):
        Detector.learn(recordings, settings=replace(DETECTOR, false_alarm_rate=rate))


def test_a_saved_and_loaded_detector_has_the_same_result(detector: Detector, tmp_path: Path) -> None:
    taught = detector.with_seeded({"friction": runs(WORN, 2, seed=15)[0]})
    taught.save(tmp_path / "detector.json")
    loaded = Detector.load(tmp_path / "detector.json")
    loaded.save(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "detector.json").read_bytes()
    later, _ = runs(STIFF_UP, 1, seed=16, cycles=3)
    assert loaded.judge(later).to_dict() == taught.judge(later).to_dict()
    assert loaded.settings == taught.settings


def test_each_load_is_judged_by_its_own_healthy_cycles() -> None:
    light, groups = runs(HEALTHY, 8, seed=17, load=100.0)
    heavy, _ = runs(HEALTHY, 8, seed=18, load=-300.0)
    known = Detector.learn([*light, *heavy], groups=[*groups, *(100 + k for k in groups)])
    assert [one.name for one in known.manoeuvres[0].loads] == ["load 100", "load -300"]
    for load in (100.0, -300.0):
        assert known.judge(runs(HEALTHY, 1, seed=19, load=load)[0]).like_healthy
    with pytest.raises(
        RecordingError, match=r"no healthy cycles at the load 200 \(known: load 100, load -300"
    ):
        known.judge(runs(HEALTHY, 1, seed=20, load=200.0)[0])
    with pytest.raises(RecordingError, match="another manoeuvre or load"):
        known.judge([light[0], heavy[0]])


def changed(recording: Recording, **columns: object) -> Recording:
    return Recording({**recording.channels, **columns}, "instant", "changed.csv")  # type: ignore[dict-item]


def test_a_manoeuvre_without_healthy_cycles_is_refused(detector: Detector) -> None:
    one = runs(HEALTHY, 1, seed=21)[0][0]
    with pytest.raises(
        RecordingError,
        match=r"changed\.csv: the detector has no healthy cycles of this manoeuvre \(its command",
    ):
        detector.judge(changed(one, command_rad=one["command_rad"] ** 2))
    with pytest.raises(RecordingError, match=r"a row every 0\.02 s, not 0\.04 s"):
        detector.judge(changed(one, time_s=one["time_s"] / 2))
    short = {name: values[:100] for name, values in one.channels.items()}
    with pytest.raises(RecordingError, match="100 rows, not 120"):
        detector.judge(Recording(short))


def test_a_missing_channel_is_named(detector: Detector) -> None:
    one = runs(HEALTHY, 1, seed=22)[0][0]
    rest = {name: values for name, values in one.channels.items() if name != "position_rad"}
    with pytest.raises(RecordingError, match="no position_rad, which the detector has learned with"):
        detector.judge(Recording(rest))


def test_too_little_to_learn_from_is_refused() -> None:
    recordings, groups = runs(HEALTHY, 4, seed=23, cycles=5)
    with pytest.raises(RecordingError, match="4 healthy runs of this manoeuvre, at least 5"):
        Detector.learn(recordings, groups=groups)
    with pytest.raises(RecordingError, match="no healthy recordings"):
        Detector.learn([])
    with pytest.raises(MethodError, match="3 groups for 20 recordings"):
        Detector.learn(recordings, groups=[1, 2, 3])
    with pytest.raises(MethodError, match="rate of false alarms of 0 is impossible"):
        Detector.learn(recordings, settings=replace(DETECTOR, false_alarm_rate=0.0))
    seven, _ = runs(HEALTHY, 7, seed=24)
    other, _ = runs(HEALTHY, 2, seed=25, load=-100.0)
    with pytest.raises(RecordingError, match="2 healthy runs at the load -100, at least 3"):
        Detector.learn([*seven, *other])


@pytest.mark.parametrize(
    "content",
    [
        "",
        "{}",
        "[1]",
        '{"format": "emaphm detector 1"}',
        "\x00\x01",
        '{"format": "emaphm detector 1", "version": 3',
    ],
)
def test_a_file_that_is_no_detector_is_refused(content: str, tmp_path: Path) -> None:
    path = tmp_path / "detector.json"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(MethodError, match=r"detector\.json: no detector .*write one with"):
        Detector.load(path)
    with pytest.raises(MethodError, match="no such file"):
        Detector.load(tmp_path / "absent.json")


def test_a_file_of_a_newer_version_asks_for_an_update(detector: Detector, tmp_path: Path) -> None:
    path = tmp_path / "detector.json"
    detector.save(path)
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("emaphm detector 1", "emaphm detector 12", 1), encoding="utf-8")
    with pytest.raises(MethodError, match=r"'emaphm detector 12'.*reads 'emaphm detector 1'; update emaphm$"):
        Detector.load(path)


def test_a_file_whose_sizes_do_not_agree_is_refused(detector: Detector, tmp_path: Path) -> None:
    path = tmp_path / "detector.json"
    detector.save(path)
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace('"channels": ["current_A", ', '"channels": [', 1), encoding="utf-8")
    with pytest.raises(MethodError, match="sizes of a manoeuvre's parts do not agree"):
        Detector.load(path)


def test_the_figure_shows_both_statistics_and_every_segment(detector: Detector) -> None:
    result = detector.judge(runs(STIFF_UP, 1, seed=26)[0])
    figure = result.plot()
    labels = {
        text.get_text() for axis in figure.axes for text in (*axis.get_xticklabels(), *axis.get_yticklabels())
    }
    assert {"current_A", "position_rad"} <= labels


def test_a_load_that_was_not_recorded_has_no_value(tmp_path: Path) -> None:
    def without_load(recordings: list[Recording]) -> list[Recording]:
        kept = [{name: one[name] for name in one.names if name != "load_Nm"} for one in recordings]
        return [one.with_channels(channels, []) for one, channels in zip(recordings, kept, strict=True)]

    recordings, groups = runs(HEALTHY, 10, seed=3)
    known = Detector.learn(without_load(recordings), groups=groups)
    known.save(tmp_path / "known.json")
    known = Detector.load(tmp_path / "known.json")
    assert known.to_dict()["manoeuvres"][0]["loads"] == ["load not recorded"]
    assert "load 0" not in str(known)
    # A healthy unit under another load is not like healthy, and the sentence names this possible cause.
    (loaded,) = without_load(runs(HEALTHY, 1, seed=41, load=600.0)[0])
    result = known.judge(loaded)
    assert not result.like_healthy
    assert "no load was recorded, and another load" in result.sentence
    assert not result.to_dict()["load_recorded"]
    assert result.manoeuvre.endswith("load not recorded")
    (healthy,) = without_load(runs(HEALTHY, 1, seed=42)[0])
    assert "another load" not in known.judge(healthy).sentence
    with pytest.raises(RecordingError, match=r"at the load 600 \(known: load not recorded\)"):
        known.judge(runs(HEALTHY, 1, seed=43, load=600.0)[0])


def test_noise_of_a_load_cell_is_no_other_load() -> None:
    recordings, groups = runs(HEALTHY, 10, seed=3)
    random = np.random.default_rng(0)
    unloaded = [
        one.with_channels({**one.channels, "load_Nm": 1e-3 * random.standard_normal(one.samples)}, [])
        for one in recordings
    ]
    known = Detector.learn(unloaded, groups=groups)
    assert [len(one.loads) for one in known.manoeuvres] == [1]
