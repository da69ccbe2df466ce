"""The verbs in normal use: what they print, write and pass to each other."""

import json
import re
import shutil
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import polars as pl
import pytest
import scipy.io
from matplotlib.figure import Figure

from emaphm.actuator import NAMES, Actuator, Faults
from emaphm.cli import main
from emaphm.cli.verbs import beyond_stops
from emaphm.diagnosis import Diagnosis, diagnose
from emaphm.recording import Recording
from emaphm.version import VERSION

from . import files
from .conftest import Emaphm, Refusal

EMPS = Path(__file__).resolve().parents[2] / "examples" / "emps" / "emps.toml"

TRUTH = ("--fault", "friction=0.3", "--fault", "short_b=0.2")

TRUE_K = Faults(friction=0.3, short_b=0.2).vector

QUICK = ("--nuisance", "none", "--no-correction")
"""Options of a diagnosis in a tenth of the time, for tests that do not check its values."""

DIAGNOSIS = {
    "faults",
    "k",
    "method",
    "fitness",
    "residual_rms_A",
    "explained",
    "laws",
    "evaluations",
    "seconds",
    "seed",
    "recording",
    "actuator",
    "version",
}
"""Keys of `diagnose --json` that the design specifies."""


def _refuse(constant: str) -> NoReturn:
    raise AssertionError(f"{constant} is no JSON")


def parsed(emaphm: Emaphm, *arguments: str | Path) -> dict[str, Any]:
    """Return a function that runs a command and returns the JSON object it prints."""
    code, out, err = emaphm(*arguments, "--json")
    assert (code, err) == (0, "")
    assert out.count("\n") == 1
    # Python's own parser accepts NaN and Infinity, which are not JSON.
    result = json.loads(out, parse_constant=_refuse)
    assert isinstance(result, dict)
    return result


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the file of a recording with the faults `TRUTH`, simulated by the reference model."""
    path = tmp_path_factory.mktemp("made") / "faulty.csv"
    assert main(["simulate", str(path), *TRUTH, "--duration", "0.2", "--json"]) == 0
    return path


@pytest.fixture
def faulty(desk: Path, made: Path) -> Path:
    """Return that recording in the current folder."""
    return Path(shutil.copy(made, desk))


def test_simulate_writes_the_recording_that_it_reports(emaphm: Emaphm, desk: Path) -> None:
    answer = parsed(
        emaphm, "simulate", "out.parquet", "--duration", "0.3", "--sample-rate", "2000", "--seed", "3", *TRUTH
    )
    written = pl.read_parquet(desk / "out.parquet")
    assert written.columns == answer["channels"]
    assert written.height == answer["samples"] == 600
    assert answer["duration_s"] == pytest.approx(0.3)
    assert answer["sample_rate_hz"] == pytest.approx(2000)
    np.testing.assert_array_equal(answer["k"], TRUE_K)
    assert (answer["recording"], answer["model"], answer["actuator"]) == (
        "out.parquet",
        "reference",
        "thesis",
    )
    assert (answer["seed"], answer["version"]) == (3, VERSION)


@pytest.fixture
def retracted(tmp_path: Path) -> Path:
    """Return the description of an actuator whose position counts from one of its end stops."""
    path = tmp_path / "retracted.toml"
    path.write_text(files.thesis_with("[-0.5236, 0.5236]", "[0.0, 0.6]"), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("options", "lowest", "highest", "said"),
    [
        ((), 0.295, 0.305, ()),
        (("--about", "0.1"), 0.095, 0.105, ()),
        (("--about", "0.001"), -0.004, 0.006, ("to 0.006; the end stops [0.0, 0.6] limit the shaft",)),
        (("--command", "ramp", "--amplitude", "0.05"), 0.0, 0.05, ()),
        (("--command", "ramp", "--amplitude", "-0.2"), 0.2, 0.4, ()),
        (("--command", "step", "--amplitude", "0.4"), 0.0, 0.4, ()),
        (("--command", "file.csv"), 0.2, 0.21, ("file.csv: the command starts at 0.2", "give --about 0.2")),
        (("--command", "file.csv", "--about", "0.2"), 0.2, 0.21, ()),
        (
            ("--command", "file.csv", "--about", "0.2", "--duration", "0.3"),
            0.2,
            0.206,
            ("goes on to 0.5 s, but only 0.3 s of it are used", "give --duration 0.5"),
        ),
    ],
)
def test_simulate_starts_with_room_to_move_and_warns_of_a_doubtful_range(
    emaphm: Emaphm,
    desk: Path,
    retracted: Path,
    options: tuple[str, ...],
    lowest: float,
    highest: float,
    said: tuple[str, ...],
) -> None:
    (desk / "file.csv").write_text("time_s,command_rad\n0,0.2\n0.5,0.21\n", encoding="utf-8")
    code, _, err = emaphm(
        "simulate", desk / "out.csv", "--actuator", retracted, "--model", "averaged", "--force", *options
    )
    assert code == 0
    command = pl.read_csv(desk / "out.csv")["command_rad"].to_numpy()
    assert (command.min(), command.max()) == pytest.approx((lowest, highest), abs=1e-4)
    assert all(text in err for text in said)
    assert bool(err) == bool(said)


def test_a_command_that_moves_only_after_the_duration_is_refused(desk: Path, refused: Refusal) -> None:
    (desk / "late.csv").write_text("time_s,command_rad\n0,0.2\n1,0.2\n2,0.21\n", encoding="utf-8")
    message = refused("simulate", desk / "out.csv", "--command", desk / "late.csv", "--about", "0.2")
    assert "goes on to 2 s, but only 0.5 s of it are used" in message
    assert "give --duration 2" in message


def test_a_shaft_that_overshoots_into_a_stop_is_reported() -> None:
    mechanics = Actuator.thesis().mechanics.model_copy(update={"end_stops": (0.0, 0.6)})
    retracted = Actuator.thesis().model_copy(update={"mechanics": mechanics})
    into = "the shaft runs into the end stop at 0, beyond the range of its command"
    for first, last, said in ((0.1, 0.0, into), (0.0, 0.1, None), (0.1, 0.01, None)):
        columns = {"time_s": np.arange(60) / 1e3, "command_rad": np.full(60, 0.1)}
        recording = Recording(columns | {"position_rad": np.linspace(first, last, 60)})
        assert beyond_stops(recording, retracted) == said


def test_simulate_reports_the_file_of_the_recording(emaphm: Emaphm, desk: Path) -> None:
    code, out, err = emaphm("simulate", "out.csv", "--model", "averaged")
    assert (code, err) == (0, "")
    for piece in ("2500 rows", "5000 Hz", "current_A", "written to out.csv"):
        assert piece in out
    assert (desk / "out.csv").is_file()


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ((), lambda t: 5e-3 * np.sin(2 * np.pi * 15 * t**2)),
        (("--frequency", "6"), lambda t: 5e-3 * np.sin(2 * np.pi * 6 * t**2)),
        (("--command", "decaying-chirp"), lambda t: 5e-3 * np.sin(2 * np.pi * 15 * t**2) * (1 - 2 * t)),
        (("--command", "sine"), lambda t: 5e-3 * np.sin(2 * np.pi * 4 * t)),
        (
            ("--command", "sine", "--frequency", "7", "--amplitude", "2e-3"),
            lambda t: 2e-3 * np.sin(14 * np.pi * t),
        ),
        (("--command", "step", "--amplitude", "-1e-3"), lambda t: np.where(t < 0.05, 0.0, -1e-3)),
        (("--command", "ramp", "--amplitude", "0.01"), lambda t: 0.01 * t / 0.5),
    ],
)
def test_the_named_commands_are_played(
    emaphm: Emaphm, desk: Path, options: tuple[str, ...], expected: Any
) -> None:
    assert emaphm("simulate", "out.csv", "--model", "averaged", *options).code == 0
    written = pl.read_csv(desk / "out.csv")
    # Rows are means over their interval; the mean of a linear command is its value amid the step points.
    middle = written["time_s"].to_numpy() + 0.5 / 5000
    # A mean over 0.2 ms at up to 15 Hz differs from the mid value by (2 pi 15)² (2e-4)² / 24 of it; the
    # points of the mean lie a quarter step early, 2 pi 15 Hz × 25 µs.
    np.testing.assert_allclose(written["command_rad"], expected(middle), atol=5e-3 * 3e-3)


@pytest.mark.parametrize("ending", ["csv", "parquet", "mat"])
def test_command_and_load_come_from_files(emaphm: Emaphm, desk: Path, ending: str) -> None:
    write = {"csv": files.csv, "parquet": files.parquet, "mat": files.mat}[ending]
    signal = {
        "time_s": np.array([0.0, 0.1, 0.2]),
        "command_rad": np.array([0.0, 2e-3, 2e-3]),
        "load_Nm": np.array([0.02, 0.02, 0.04]),
    }
    (desk / f"signal.{ending}").write_bytes(write(signal))
    options = ("--command", f"signal.{ending}", "--load", f"signal.{ending}", "--model", "averaged")
    answer = parsed(emaphm, "simulate", "out.csv", *options, "--duration", "0.3")
    assert "load_Nm" in answer["channels"]
    written = pl.read_csv(desk / "out.csv")
    middle = written["time_s"].to_numpy() + 0.5 / 5000
    # Linear between the samples and held after the last; a row's mean deviates by half a step of the model.
    for name in ("command_rad", "load_Nm"):
        expected = np.interp(middle, signal["time_s"], signal[name])
        np.testing.assert_allclose(written[name], expected, atol=0.02 / 0.1 * 5e-5)


@pytest.mark.parametrize("load", ["0.03", "-0.03"])
def test_a_constant_load_is_recorded(emaphm: Emaphm, desk: Path, load: str) -> None:
    assert emaphm("simulate", "out.csv", "--model", "averaged", "--load", load).code == 0
    np.testing.assert_allclose(pl.read_csv(desk / "out.csv")["load_Nm"], float(load))


def test_the_same_seed_gives_the_same_recording_and_another_seed_a_different_one(
    emaphm: Emaphm, desk: Path
) -> None:
    for name, seed in (("a.csv", "1"), ("b.csv", "1"), ("c.csv", "2")):
        options = ("--model", "averaged", "--noise", "0.05", "--seed", seed)
        assert emaphm("simulate", name, *options).code == 0
    first, repeated, another_seed = ((desk / name).read_bytes() for name in ("a.csv", "b.csv", "c.csv"))
    assert first == repeated
    assert first != another_seed


def test_converters_have_the_requested_resolution(emaphm: Emaphm, desk: Path) -> None:
    assert emaphm("simulate", "out.csv", "--model", "averaged", "--adc-bits", "8").code == 0
    # 8 bits over plus and minus twice the current limit of 22.5 A.
    codes = pl.read_csv(desk / "out.csv")["current_A"].to_numpy() / (90 / 2**8)
    np.testing.assert_allclose(codes, np.round(codes), atol=1e-9)
    assert np.unique(codes).size > 10


def test_diagnose_estimates_the_simulated_faults(emaphm: Emaphm, faulty: Path) -> None:
    answer = parsed(emaphm, "diagnose", faulty.name)
    assert answer.keys() >= DIAGNOSIS
    assert tuple(answer["faults"]) == NAMES
    for name, value, truth in zip(NAMES, answer["k"], TRUE_K, strict=True):
        component = answer["faults"][name]
        assert component["value"] == value
        assert component.keys() >= {"value", "interval95", "identifiable"}
        if component["identifiable"]:
            # The project's own target for noise-free single faults is 1.4 %; this leaves it room.
            assert value == pytest.approx(truth, abs=0.02)
            assert component["interval95"][0] <= value <= component["interval95"][1]
    assert answer["faults"]["friction"]["verdict"] == "degraded"
    assert answer["faults"]["short_b"]["verdict"] == "degraded"
    assert answer["explained"] is True
    assert answer["laws"] == []
    assert (answer["recording"], answer["actuator"]) == ("faulty.csv", "thesis")
    assert (answer["method"], answer["seed"], answer["version"]) == ("hybrid", 0, VERSION)


def test_the_file_format_does_not_matter(emaphm: Emaphm, faulty: Path, desk: Path) -> None:
    pl.read_csv(faulty).write_parquet(desk / "faulty.parquet")
    from_csv, from_parquet = (
        parsed(emaphm, "diagnose", f"faulty.{ending}", *QUICK) for ending in ("csv", "parquet")
    )
    for answer in (from_csv, from_parquet):
        del answer["seconds"], answer["recording"]
    assert from_csv == from_parquet


@pytest.mark.parametrize(("method", "options"), [("hybrid", ("--nuisance", "none")), ("dragonfly", ())])
@pytest.mark.usefixtures("desk")
def test_the_same_seed_gives_the_same_diagnosis(
    emaphm: Emaphm, method: str, options: tuple[str, ...]
) -> None:
    # Short, because the time of a swarm grows with the number of rows.
    assert emaphm("simulate", "faulty.csv", *TRUTH, "--duration", "0.05").code == 0

    def diagnosis(seed: int) -> dict[str, Any]:
        answer = parsed(emaphm, "diagnose", "faulty.csv", "--method", method, "--seed", str(seed), *options)
        assert answer.pop("seconds") > 0
        assert answer.pop("seed") == seed
        assert answer["method"] == method
        return answer

    first = diagnosis(7)
    assert diagnosis(7) == first
    assert diagnosis(8) != first


@pytest.mark.usefixtures("desk")
def test_diagnose_samples_the_posterior_on_request(emaphm: Emaphm) -> None:
    # Short and slow, because the time of a random walk grows with the number of rows.
    short = ("--duration", "0.15", "--sample-rate", "2000")
    assert emaphm("simulate", "faulty.csv", *TRUTH, *short).code == 0
    plain = ("diagnose", "faulty.csv", *QUICK)
    answer = parsed(emaphm, *plain, "--posterior")
    assert set(answer["posterior"]) == {"faults", "samples", "convergence"}
    assert answer["posterior"]["convergence"]["converged"] is True
    for name, sampled in answer["posterior"]["faults"].items():
        low, high = sampled["interval95"]
        assert low <= sampled["median"] <= high
        assert name in answer["faults"]
    assert "posterior" not in parsed(emaphm, *plain)


def test_diagnose_works_without_bias_correction(emaphm: Emaphm, faulty: Path) -> None:
    corrected = parsed(emaphm, "diagnose", faulty.name, "--nuisance", "none")
    plain = parsed(emaphm, "diagnose", faulty.name, *QUICK)
    assert plain["evaluations"] < corrected["evaluations"]
    assert plain["reference_runs"] < corrected["reference_runs"]


def test_text_output_has_a_table_and_a_report(emaphm: Emaphm, faulty: Path, desk: Path) -> None:
    code, out, err = emaphm("diagnose", faulty.name, *QUICK, "--report", "report.html")
    assert (code, err) == (0, "")
    for piece in (*NAMES, "degraded", "healthy", "explains the recording", "seed 0", "report.html"):
        assert piece in out
    page = (desk / "report.html").read_text(encoding="utf-8")
    for piece in ("<html", *NAMES, "faulty.csv", "thesis"):
        assert piece in page


def test_json_stays_json_with_a_report(
    emaphm: Emaphm, faulty: Path, desk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("emaphm.report.write.svg", lambda _: b"<svg/>")  # its figures are drawn above
    answer = parsed(emaphm, "diagnose", faulty.name, *QUICK, "--report", "report.html")
    assert answer.keys() >= DIAGNOSIS
    assert (desk / "report.html").is_file()


def test_replay_with_the_true_faults_has_a_smaller_error(emaphm: Emaphm, faulty: Path) -> None:
    healthy, true = (
        parsed(emaphm, "replay", faulty.name, *faults)["relative_error"] for faults in ((), TRUTH)
    )
    # The averaged model is within 3 to 4 % of the reference model's current.
    assert true["current_A"] < 0.05 < healthy["current_A"]
    assert true.keys() == healthy.keys() >= {"current_A", "position_rad", "speed_rad_s", "angle_rad"}


def test_replay_by_the_model_that_made_the_recording_has_a_negligible_error(
    emaphm: Emaphm, faulty: Path
) -> None:
    answer = parsed(emaphm, "replay", faulty.name, "--model", "reference", *TRUTH)
    assert answer["model"] == "reference"
    # Only the means of the command are known, 0.2 ms apart.
    assert answer["relative_error"]["position_rad"] < 1e-3


def test_replay_compares_several_recordings_and_writes_their_signals(emaphm: Emaphm, desk: Path) -> None:
    (desk / "servo.csv").write_bytes(files.csv(files.without("current_A", "speed_rad_s")))
    answer = parsed(emaphm, "replay", "good.csv", "servo.csv", "--series", "series.csv")
    assert [item["recording"] for item in answer["recordings"]] == ["good.csv", "servo.csv"]
    assert answer["recordings"][0] == parsed(emaphm, "replay", "good.csv")
    assert answer["recordings"][1]["rms_error"].keys() == {"position_rad"}
    assert answer["mean_absolute_error"]["position_rad"] <= answer["rms_error"]["position_rad"]
    table = pl.read_csv(desk / "series.csv")
    assert len(table) == 400
    assert {"recording", "time_s", "position_rad", "position_rad_model", "current_A_model"} <= set(
        table.columns
    )
    assert "exists already" in emaphm("replay", "good.csv", "--series", "series.csv").err
    text = emaphm("replay", "good.csv", "servo.csv", "--series", "series.csv", "--force").out
    for piece in (
        "good.csv\n",
        "All 2 recordings",
        "mean abs. error",
        "rad",
        "Signals written to series.csv",
    ):
        assert piece in text


def test_replay_warns_of_a_model_far_from_the_recording(emaphm: Emaphm, desk: Path) -> None:
    (desk / "reversed.csv").write_bytes(files.csv(files.scaled(position_rad=-1)))
    warnings = parsed(emaphm, "replay", "reversed.csv")["warnings"]
    assert any(warning.startswith("position_rad deviates by") for warning in warnings)
    assert "Warning: position_rad" in emaphm("replay", "reversed.csv").out


def test_a_jittering_clock_has_a_note(emaphm: Emaphm, desk: Path) -> None:
    moves = np.random.default_rng(0).uniform(-0.05, 0.05, 200)
    jittered = files.columns() | {"time_s": files.columns()["time_s"] + 1e-3 * moves}
    (desk / "jitter.csv").write_bytes(files.csv(jittered))
    calibration = ("calibrate", "--free=inertia", "-o=out.toml", "--force", "--no-correction")
    for verb, *options in (("replay",), ("diagnose", "--no-correction"), calibration):
        (note,) = parsed(emaphm, verb, "jitter.csv", *options)["notes"]
        assert "resampled to 1000 Hz" in note
        assert note in emaphm(verb, "jitter.csv", *options).out


def test_the_json_of_an_unconnected_sensor_is_valid(emaphm: Emaphm, desk: Path) -> None:
    (desk / "still.csv").write_bytes(files.csv(files.scaled(speed_rad_s=0)))
    # Its relative error would be a division by zero.
    assert parsed(emaphm, "replay", "still.csv")["relative_error"].keys() == {"position_rad", "current_A"}


def test_replay_uses_the_calibrated_description(emaphm: Emaphm, desk: Path) -> None:
    worn = files.thesis_with("inertia_motor = 1.3e-05", "inertia_motor = 2.3e-05")
    (desk / "worn.toml").write_text(worn, encoding="utf-8")
    options = ("--actuator", "worn.toml", "--model", "averaged")
    assert emaphm("simulate", "worn.csv", *options).code == 0
    error_before = parsed(emaphm, "replay", "worn.csv")["relative_error"]
    # The averaged model made the recording, on a day without load or heat.
    exact = ("--no-correction", "--nuisance", "none")
    answer = parsed(emaphm, "calibrate", "worn.csv", "--free", "inertia,viscous", "-o", "found.toml", *exact)
    assert list(answer["parameters"]) == ["inertia", "viscous"]
    inertia = answer["parameters"]["inertia"]
    assert inertia["unit"] == "kg·m²"
    # The same model made the recording: the error is from the command, of which only the means are known.
    assert inertia["value"] == pytest.approx(3.5e-5, rel=0.01)
    assert 0 < inertia["standard_error"] < 0.01 * inertia["value"]
    answer_after = parsed(emaphm, "replay", "worn.csv", "--actuator", "found.toml")
    assert answer_after["relative_error"] == pytest.approx(answer["relative_error"])
    assert answer_after["relative_error"]["current_A"] < 0.1 * error_before["current_A"]
    described = Actuator.from_toml("found.toml")
    assert described.mechanics.inertia == pytest.approx(inertia["value"])
    assert answer_after["actuator"] == described.name == answer["actuator"]
    comments = (desk / "found.toml").read_text(encoding="utf-8").splitlines()
    assert comments[0].startswith("# Calibrated on worn.csv: inertia, viscous")


def test_a_baseline_from_several_recordings_is_used_in_later_diagnoses(emaphm: Emaphm, desk: Path) -> None:
    for name, frequency in (("monday.csv", "15"), ("tuesday.csv", "11")):
        options = ("--model", "averaged", "--noise", "0.1", "--duration", "0.3", "--frequency", frequency)
        assert emaphm("simulate", name, *options).code == 0
    days = ("monday.csv", "tuesday.csv")
    answer = parsed(
        emaphm,
        "calibrate",
        *days,
        "--free",
        "coulomb",
        "-o",
        "unit.toml",
        "--no-correction",
        "--nuisance",
        "none",
    )
    assert [item["recording"] for item in answer["recordings"]] == list(days)
    assert answer["birge_ratio"] > 0
    baseline = Actuator.from_toml("unit.toml").baseline
    assert baseline is not None
    assert (baseline.names, baseline.recordings) == (("coulomb",), days)
    coulomb = answer["parameters"]["coulomb"]
    assert baseline.covariance[0][0] ** 0.5 == pytest.approx(coulomb["standard_error"] / coulomb["value"])
    comments = (desk / "unit.toml").read_text(encoding="utf-8").splitlines()
    assert comments[0].startswith("# Calibrated on monday.csv, tuesday.csv: coulomb;")
    # A larger scatter between the days, so that the diagnosis has a scatter to allow for.
    wider = (
        (desk / "unit.toml").read_text(encoding="utf-8").replace(repr(baseline.covariance[0][0]), "0.0009")
    )
    (desk / "unit.toml").write_text(wider, encoding="utf-8")
    diagnosis = parsed(
        emaphm, "diagnose", "monday.csv", "--actuator", "unit.toml", "--nuisance", "none", "--no-correction"
    )
    assert list(diagnosis["nuisances"]) == ["baseline coulomb"]
    assert diagnosis["covariance"]["coordinates"][-1] == "baseline coulomb"


def test_a_campaign_file_gives_the_conditions_of_each_recording(emaphm: Emaphm, desk: Path) -> None:
    for name, frequency in (("monday.csv", "15"), ("tuesday.csv", "11")):
        options = ("--model", "averaged", "--noise", "0.1", "--duration", "0.3", "--frequency", frequency)
        assert emaphm("simulate", name, *options).code == 0
    rows = "file,load,free\nmonday.csv,0,\ntuesday.csv,,torque_constant\n"
    (desk / "week.csv").write_text(rows, encoding="utf-8")
    answer = parsed(
        emaphm, "calibrate", "week.csv", "--free", "coulomb", "-o", "unit.toml", "--no-correction"
    )
    first, second = answer["recordings"]
    assert (first["recording"], second["recording"]) == ("monday.csv", "tuesday.csv")
    assert (first["known"], first["own"]) == ({"load": 0.0}, {})
    assert second["own"]["torque_constant"] == pytest.approx(0.0752, rel=0.05)
    assert "load" in second["nuisances"]
    assert "load" not in first["nuisances"]


def test_a_recording_counts_once_whichever_campaign_names_it(refused: Refusal, desk: Path) -> None:
    for name in ("monday.csv", "tuesday.csv"):
        (desk / name).write_text("file,load\ngood.csv,0\n", encoding="utf-8")
    options = ("--free", "coulomb", "-o", "unit.toml")
    assert "given twice" in refused("calibrate", "monday.csv", "good.csv", *options)
    assert "given twice, as good.csv" in refused("calibrate", "good.csv", desk / "good.csv", *options)
    message = refused("calibrate", "monday.csv", "tuesday.csv", *options)
    assert "tuesday.csv, row 1: good.csv: this file is given twice" in message


def test_measured_motion_needs_no_controller(emaphm: Emaphm, desk: Path) -> None:
    assert emaphm("simulate", "rig.csv", "--noise", "0.02").code == 0
    half = files.thesis_with("position_gain = 100000.0", "position_gain = 50000.0")
    (desk / "half.toml").write_text(half, encoding="utf-8")
    options = (
        "rig.csv",
        "--actuator",
        "half.toml",
        "--free",
        "inertia,coulomb",
        "-o",
        "unit.toml",
        "--force",
    )
    answer = parsed(emaphm, "calibrate", *options)
    assert answer["loop"] == "measured"
    assert "described 5e+04" in answer["loop_reason"]
    assert answer["parameters"]["inertia"]["value"] == pytest.approx(2.5e-5, rel=2e-3)
    text = emaphm("calibrate", *options, "--loop", "measured").out
    assert "Calibrated by measured motion: as asked for." in text
    assert "torque by the measured motion" in text
    assert "# Calibrated by measured motion" in (desk / "unit.toml").read_text(encoding="utf-8")


@pytest.mark.evidence
def test_a_real_machine_from_calibration_to_diagnosis(emaphm: Emaphm, desk: Path, emps_file: Path) -> None:
    free = "inertia, viscous, coulomb, offset"
    # With a part of the rows, calibration and diagnosis take a part of the time.
    data = {name: values for name, values in scipy.io.loadmat(emps_file).items() if not name.startswith("__")}
    for name, parts in (("half.mat", 2), ("quarter.mat", 4)):
        rows = {key: values[: -(-len(values) // parts)] for key, values in data.items()}
        (desk / name).write_bytes(files.mat(rows))
    answer = parsed(emaphm, "calibrate", "half.mat", "--actuator", EMPS, "--free", free, "-o", "unit.toml")
    # Janot, Gautier, Brunot 2019: 95.1089 kg; force error of their closed-loop simulation 5.848 %.
    assert answer["parameters"]["inertia"]["value"] == pytest.approx(95.1089, rel=0.01)
    assert answer["parameters"]["inertia"]["unit"] == "kg"
    replayed = parsed(emaphm, "replay", "half.mat", "--actuator", "unit.toml")
    assert replayed["relative_error"] == pytest.approx(answer["relative_error"])
    assert replayed["relative_error"]["current_A"] <= 0.0585
    chosen = ("--actuator", "unit.toml", "--nuisance", "load")
    diagnosis = parsed(emaphm, "diagnose", "quarter.mat", *chosen, "--report", "unit.html")
    assert diagnosis["faults"]["friction"]["verdict"] == "healthy"
    assert diagnosis["faults"]["short_a"]["identifiable"] is False
    assert "electrical" in diagnosis["faults"]["short_a"]["reason"]
    assert (desk / "unit.html").is_file()


def check_demo(answer: dict[str, Any], desk: Path) -> None:
    """Check the JSON answer of the demonstration and its files."""
    assert answer.keys() >= DIAGNOSIS
    assert np.abs(np.array(answer["k"]) - answer["true_k"]).max() < 0.02
    assert 0 < answer["error_percent"] < 2
    assert {path.name for path in (desk / "demo").iterdir()} == {"report.html", "diagnosis.svg"}
    assert answer["report"] == str(Path("demo", "report.html"))
    assert "<html" in (desk / answer["report"]).read_text(encoding="utf-8")
    assert (desk / answer["figure"]).read_bytes().startswith(b"<?xml")


# With all corrections; the next test is its quick form.
@pytest.mark.evidence
def test_the_demo_estimates_the_faults_that_it_simulated(emaphm: Emaphm, desk: Path) -> None:
    answer = parsed(emaphm, "demo")
    check_demo(answer, desk)


def test_the_demo_prints_the_estimate_and_the_truth(
    emaphm: Emaphm, desk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    diagnoses = list[Diagnosis]()

    def once(*recorded: Any, **settings: Any) -> Diagnosis:
        if not diagnoses:
            # One correction is accurate enough for the printed digits, and takes half the time.
            diagnoses.append(diagnose(*recorded, **settings, nuisances=(), max_corrections=1))
        return diagnoses[0]

    monkeypatch.setattr("emaphm.demo.diagnose", once)
    monkeypatch.setattr("emaphm.report.write.svg", lambda _: b"<svg/>")  # its figures are drawn above
    answer = parsed(emaphm, "demo", "--seed", "1")
    check_demo(answer, desk)
    # Its figure was drawn above.
    monkeypatch.setattr("emaphm.demo.draw_diagnosis", lambda *_: Figure())
    code, out, err = emaphm("demo", "--out", "new/folder", "--seed", "1")
    assert (code, err) == (0, "")
    for piece in ("true", "estimate", *NAMES, "0.7000", "Error: ", str(Path("new", "folder", "report.html"))):
        assert piece in out
    assert (desk / "new" / "folder" / "report.html").is_file()
    (error,) = re.findall(r"Error: (\d\.\d\d) %", out)
    assert 0 < float(error) < 2


def test_version_is_printed(emaphm: Emaphm) -> None:
    assert emaphm("--version") == (0, f"{VERSION}\n", "")


PROMISED = {
    "demo": ("--seed", "--json"),
    "simulate": (
        *(
            "--model",
            "--command",
            "--fault",
            "--noise",
            "--duration",
            "--sample-rate",
            "--load",
            "--actuator",
        ),
        *("--seed", "--json"),
    ),
    "diagnose": ("--actuator", "--method", "--report", "--seed", "--json"),
    "calibrate": ("--actuator", "--free", "-o", "--seed", "--json"),
    "replay": ("--actuator", "--seed", "--json"),
    "watch": ("--db", "--unit", "--hours", "--name", "--webhook", "--once", "--seed"),
}


@pytest.mark.parametrize("verb", PROMISED)
def test_help_names_all_documented_verbs_and_options(emaphm: Emaphm, verb: str) -> None:
    assert verb in emaphm("--help").out
    code, out, err = emaphm(verb, "--help")
    assert (code, err) == (0, "")
    for option in PROMISED[verb]:
        assert option in out


def test_help_is_shown_without_a_verb(emaphm: Emaphm) -> None:
    assert emaphm() == emaphm("--help")
