"""`emaphm detect` and `diagnose --healthy`: printed results and refusals."""

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from emaphm.actuator import Chirp, Faults
from emaphm.cli.command_line import app
from emaphm.recording import write_recording
from emaphm.simulated_recording import simulate

from .conftest import Emaphm, Refusal
from .files import THESIS as DESCRIPTION
from .files import columns, csv

COMMAND = Chirp(amplitude=5e-3, duration=0.2)
KEPT = ("time_s", "command_rad", "position_rad", "current_A")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with six healthy recordings, one with more friction, and a detector."""
    from emaphm.actuator import Actuator
    from emaphm.detection import Detector

    place = tmp_path_factory.mktemp("recordings")
    actuator = Actuator.thesis()
    recordings = []
    for seed in range(7):
        faults = Faults(friction=0.25) if seed == 6 else Faults()
        recording = simulate(
            actuator, COMMAND, faults=faults, duration=0.2, model="averaged", noise=0.1, seed=seed
        )
        reduced = recording.with_channels({name: recording[name] for name in KEPT})
        write_recording(reduced, place / ("dry.csv" if seed == 6 else f"healthy{seed}.csv"))
        recordings.append(reduced)
    Detector.learn(recordings[:6], actuator=actuator).save(place / "known.json")
    (place / "thesis.toml").write_text(DESCRIPTION, encoding="utf-8")
    return place


def test_detect_learns_from_healthy_recordings_and_judges_others(
    emaphm: Emaphm, folder: Path, tmp_path: Path
) -> None:
    healthy = sorted(folder.glob("healthy*.csv"))
    detector = tmp_path / "detector.json"
    learned = emaphm(
        "detect", "learn", *healthy, "--out", detector, f"--seeded=dry={folder / 'dry.csv'}", "--json"
    )
    assert learned.code == 0, learned.err
    answer = json.loads(learned.out)
    assert answer["seeded"] == ["dry"]
    assert answer["manoeuvres"][0]["levels"][0]["runs"] == 6
    figure = tmp_path / "figure.png"
    judged = emaphm("detect", "judge", detector, healthy[0], folder / "dry.csv", "--figure", figure, "--json")
    assert judged.code == 0, judged.err
    values = json.loads(judged.out)
    assert (values["not_like_healthy"], values["of"]) == (1, 2)
    assert [result["like_healthy"] for result in values["results"]] == [True, False]
    assert values["results"][1]["nearest"]["fault"] == "dry"
    assert figure.stat().st_size > 1000


def test_files_in_folders_are_cycles_of_one_run(emaphm: Emaphm, folder: Path, tmp_path: Path) -> None:
    healthy = sorted(folder.glob("healthy*.csv"))
    for k, file in enumerate(healthy):
        place = tmp_path / f"run{min(k, 4)}"  # the last file has two cycles
        place.mkdir(exist_ok=True)
        (place / file.name).write_bytes(file.read_bytes())
    files = sorted(tmp_path.glob("run*/*.csv"))
    answer_by_folder = emaphm("detect", "learn", *files, "--out", tmp_path / "known.json", "--json")
    answer = json.loads(answer_by_folder.out)
    assert answer["group"] == "folder"
    assert answer["manoeuvres"][0]["levels"][0]["runs"] == 5
    (note,) = answer["notes"]
    assert "6 files in 5 folders" in note
    assert "--group file" in note
    assert answer_by_folder.err == ""
    assert note in emaphm("detect", "learn", *files, "--out", tmp_path / "text.json").err
    answer_by_file = emaphm(
        "detect", "learn", *files, "--group=file", "--out", tmp_path / "other.json", "--json"
    )
    answer = json.loads(answer_by_file.out)
    assert (answer["group"], answer["notes"], answer["manoeuvres"][0]["levels"][0]["runs"]) == ("file", [], 6)
    assert answer_by_file.err == ""


def test_text_output_has_the_verdict_and_its_basis(emaphm: Emaphm, folder: Path) -> None:
    judged = emaphm("detect", "judge", folder / "known.json", folder / "dry.csv")
    assert "dry.csv: not like healthy (" in judged.out
    assert "of 6 healthy runs left out alarmed" in judged.out


def test_recordings_are_judged_by_the_names_in_the_given_description(
    emaphm: Emaphm, folder: Path, tmp_path: Path, refused: Refusal
) -> None:
    description = tmp_path / "logger.toml"
    description.write_text(DESCRIPTION + '\n[channels]\ncurrent_A = { column = "I", unit = "mA" }\n')
    table = pl.read_csv(folder / "dry.csv")
    table.with_columns(I=1e3 * pl.col("current_A")).drop("current_A").write_csv(tmp_path / "logged.csv")
    known = folder / "known.json"
    by_names = emaphm("detect", "judge", known, tmp_path / "logged.csv", "--actuator", description, "--json")
    (result,) = json.loads(by_names.out)["results"]
    (original,) = json.loads(emaphm("detect", "judge", known, folder / "dry.csv", "--json").out)["results"]
    assert result["q"] == pytest.approx(original["q"])
    assert "no such actuator file" in refused("detect", "judge", known, "good.csv", "--actuator", "no.toml")


def test_a_diagnosis_states_whether_the_recording_is_like_healthy_ones(emaphm: Emaphm, folder: Path) -> None:
    options = ("--no-correction", "--json")  # the averaged model made the recording
    answer = emaphm("diagnose", folder / "dry.csv", "--healthy", folder / "known.json", *options)
    assert answer.code == 0, answer.err
    values = json.loads(answer.out)
    assert values["detector"]["like_healthy"] is False
    assert values["faults"]["friction"]["verdict"] == "degraded"
    plain = emaphm("diagnose", folder / "dry.csv", *options)
    assert "detector" not in json.loads(plain.out)


def test_impossible_requests_are_refused_in_one_line(folder: Path, refused: Refusal) -> None:
    known = folder / "known.json"
    assert "no healthy cycles" in refused("detect", "judge", known, "good.csv")
    assert "no healthy cycles" in refused("diagnose", "good.csv", "--healthy", known)
    assert "no detector" in refused("detect", "judge", folder / "thesis.toml", "good.csv")
    assert "no recording to judge" in refused("detect", "judge", known)
    assert "no healthy recordings" in refused("detect", "learn", "--out", "new.json")
    assert "at least 5" in refused("detect", "learn", "good.csv", "--out", "new.json")
    assert "give NAME=FILE" in refused("detect", "learn", "good.csv", "--out", "new.json", "--seeded", "dry")
    assert ".json" in refused("detect", "learn", "good.csv", "--out", "new.toml")
    assert "rate of false alarms of 2" in refused(
        "detect", "learn", "good.csv", "--out", "new.json", "--false-alarm-rate", "2"
    )
    assert not Path("new.json").exists()


AS_MEASURED = "--no-subtract-model"


def test_files_of_a_folder_are_cycles_of_one_run(emaphm: Emaphm, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    paths = []
    for run in range(5):
        (tmp_path / f"run{run}").mkdir()
        for cycle in range(2):
            path = tmp_path / f"run{run}" / f"{cycle}.csv"
            table = columns()
            noisy = {**table, "current_A": table["current_A"] + 0.1 * rng.normal(size=table["time_s"].size)}
            path.write_bytes(csv(noisy))
            paths.append(path)
    out = tmp_path / "detector.json"
    learned = emaphm("detect", "learn", *paths, "-o", out, "--group", "folder", AS_MEASURED, "--json")
    assert learned.code == 0, learned.err
    levels = json.loads(learned.out)["manoeuvres"][0]["levels"]
    assert [(table["cycles"], table["runs"]) for table in levels] == [(1, 5), (2, 5)]
    judged = emaphm("detect", "judge", out, *paths[:2], "--together", "--json")
    assert json.loads(judged.out)["results"][0]["cycles"] == 2


@pytest.mark.parametrize("option", [AS_MEASURED, "--no-model", "--subtract-model", "--model"])
def test_the_former_name_of_the_model_option_is_accepted(option: str) -> None:
    _, bound, _ = app.parse_args(["detect", "learn", "good.csv", "--out", "new.json", option])
    assert bound.arguments["detection"].subtract_model is not option.startswith("--no-")
