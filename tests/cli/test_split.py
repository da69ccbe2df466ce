"""`emaphm split`: one long file is split into recordings with a matching description."""

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from emaphm.actuator import Actuator
from emaphm.actuator.toml import write_toml
from emaphm.recording import read_recording

from .conftest import Emaphm

CHANNELS = """
[channels]
command_rad = { column = "goal", unit = "mrad" }
current_A = { scale = 2.0 }

[reading]
split = "run"
"""


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Return a log of three runs; the last one is too short."""
    time = np.arange(230) / 1e3
    goal = 5 * np.sin(2 * np.pi * 10 * time)
    run = np.repeat([1, 2, 3], [100, 100, 30])
    frame = {"time_s": time, "goal": goal, "current_A": np.cos(2 * np.pi * 10 * time), "run": run}
    pl.DataFrame(frame).write_csv(tmp_path / "log.csv")
    (tmp_path / "rig.toml").write_text(f"{write_toml(Actuator.thesis())}\n{CHANNELS}")
    return tmp_path / "log.csv"


def test_split_writes_recordings_and_their_description(emaphm: Emaphm, log: Path, tmp_path: Path) -> None:
    arguments = (
        "split",
        log,
        "-o",
        tmp_path / "out",
        "--actuator",
        tmp_path / "rig.toml",
        "--known",
        "serial=A17",
    )
    answer = emaphm(*arguments, "--json")
    assert answer.code == 0, answer.err
    summary = json.loads(answer.out)
    assert [Path(recording["file"]).name for recording in summary["recordings"]] == [
        "log_0001_run_1.csv",
        "log_0002_run_2.csv",
    ]
    assert [recording["labels"] for recording in summary["recordings"]] == [
        {"run": n, "serial": "A17"} for n in (1.0, 2.0)
    ]
    assert "run 3 has 30 rows" in summary["refused"][0]
    described = Actuator.from_toml(summary["actuator"])
    second = read_recording(summary["recordings"][1]["file"], described)
    raw = pl.read_csv(log)[100:200]
    np.testing.assert_allclose(second["command_rad"], 1e-3 * raw["goal"].to_numpy(), rtol=1e-12)
    np.testing.assert_allclose(second["current_A"], 2 * raw["current_A"].to_numpy())
    assert second.labels == {"run": 2.0, "serial": "A17"}
    second_answer = emaphm(*arguments)
    assert second_answer.code == 2
    assert "--force" in second_answer.err
    assert "log_0002_run_2.csv" in emaphm(*arguments, "--force").out


def test_cleaned_and_uncleaned_values_are_read_back_unchanged(
    emaphm: Emaphm, log: Path, tmp_path: Path
) -> None:
    frame = pl.read_csv(log)
    raw = frame["current_A"].to_numpy().copy()
    raw[150] = 9.0  # an outlier
    frame.with_columns(current_A=raw).write_csv(log)
    rig = tmp_path / "rig.toml"
    rig.write_text(f"{rig.read_text()}outliers = false\n")
    assert emaphm("split", log, "-o", tmp_path / "out", "--actuator", rig).code == 0
    for description in (tmp_path / "out" / "actuator.toml", rig):
        recording = read_recording(tmp_path / "out" / "log_0002_run_2.csv", Actuator.from_toml(description))
        np.testing.assert_array_equal(recording["current_A"], 2 * raw[100:200])


def test_a_file_is_cut_where_time_jumps(emaphm: Emaphm, tmp_path: Path) -> None:
    time = np.arange(100) / 1e3
    frame = {"time_s": np.r_[time, 9.0 + time], "command_rad": np.sin(np.r_[time, time])}
    pl.DataFrame({**frame, "current_A": frame["command_rad"]}).write_csv(tmp_path / "day.csv")
    answer = emaphm("split", tmp_path / "day.csv", "-o", tmp_path / "out", "--json")
    assert answer.code == 0, answer.err
    assert [recording["samples"] for recording in json.loads(answer.out)["recordings"]] == [100, 100]


def test_the_given_description_is_not_overwritten(emaphm: Emaphm, log: Path, tmp_path: Path) -> None:
    description = (tmp_path / "rig.toml").rename(tmp_path / "actuator.toml")
    content = description.read_bytes()
    code, _, err = emaphm("split", log, "-o", tmp_path, "--actuator", description, "--force")
    assert code == 2
    assert "choose another folder" in err
    assert description.read_bytes() == content


def test_earlier_recordings_of_the_same_file_are_removed(emaphm: Emaphm, log: Path, tmp_path: Path) -> None:
    out, arguments = tmp_path / "out", ("split", log, "-o", tmp_path / "out")
    assert emaphm(*arguments, "--by", "run", "--actuator", tmp_path / "rig.toml").code == 0
    names = ("log_notes.csv", "log_0003.txt", "other_0001_run_1.csv", "log_0001_0001_run_1.csv")
    kept = [out / name for name in names]
    for path in kept:
        path.write_text("not of this command")
    described = ("--actuator", tmp_path / "rig.toml", "--force")
    assert emaphm(*arguments, "--by", "stretches", *described).code == 0
    assert set(out.iterdir()) == {out / "actuator.toml", out / "log_0001_stretch_1.csv", *kept}


def test_files_named_like_recordings_are_kept_in_a_folder_that_was_not_written_by_split(
    emaphm: Emaphm, log: Path, tmp_path: Path
) -> None:
    own = tmp_path / "log_2024_raw.csv"
    own.write_text("the user's")
    assert emaphm("split", log, "-o", tmp_path, "--actuator", tmp_path / "rig.toml", "--force").code == 0
    assert own.read_text() == "the user's"


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("--by", "rnu"), "did you mean 'run'"),
        (("--known", "temperature_K"), "give NAME=VALUE"),
        (("--known", "temperature_K=warm"), "is a number in K"),
        (("--known", "a=1", "--known", "a=2"), "given twice"),
    ],
)
def test_a_file_that_cannot_be_split_is_refused(
    emaphm: Emaphm, log: Path, tmp_path: Path, arguments: tuple[str, ...], expected: str
) -> None:
    answer = emaphm("split", log, "-o", tmp_path / "out", "--actuator", tmp_path / "rig.toml", *arguments)
    assert answer.code == 2
    assert expected in answer.err
    assert answer.err.count("\n") == 1
    assert not (tmp_path / "out").exists()
