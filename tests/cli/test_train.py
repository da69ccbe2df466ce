"""`emaphm train` and `diagnose --estimator`: refused arguments, and results."""

import json
import shutil
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from amortized.toys import THESIS, constant_estimator, short_setup
from emaphm.actuator import Chirp, Faults
from emaphm.amortized import Estimator
from emaphm.amortized.recording_setup import RecordingSetup
from emaphm.amortized.simulating import training_folder
from emaphm.cli import main
from emaphm.fleet import DiagnosisSettings, diagnose_all
from emaphm.recording import Recording, write_recording
from emaphm.simulated_recording import simulate

TRUTH = Faults(friction=0.3, gain=0.6)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("estimators")
    setup = RecordingSetup.of(THESIS, Chirp())
    constant_estimator(setup, setup.space.points(TRUTH.vector), 0.02).save(place / "unit.estimator")
    for seed in range(2):
        recording = simulate(THESIS, Chirp(), faults=TRUTH, noise=0.05, adc_bits=12, seed=seed)
        columns = {name: recording[name] for name in ("time_s", "command_rad", "current_A", "voltage_V")}
        write_recording(Recording(columns), place / f"{seed}.csv")
    return place


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["diagnose", "{0}/0.csv", "--fast"], "--estimator FILE"),
        (["diagnose", "{0}/0.csv", "--estimator", "{0}/absent.estimator"], "no such file"),
        (["diagnose", "{0}/0.csv", "--estimator", "{0}/0.csv"], "no estimator"),
        (
            ["diagnose", "{0}/0.csv", "--estimator", "{0}/unit.estimator", "--actuator", "pmsm"],
            "another description",
        ),
        (["diagnose", "{0}/0.csv", "--estimator", "{0}/unit.estimator", "--method", "ga"], "method 'hybrid'"),
        (
            ["diagnose", "{0}/0.csv", "--estimator", "{0}/unit.estimator", "--fast", "--nuisance", "load"],
            "nuisances of its training",
        ),
        (
            ["diagnose", "{0}/0.csv", "{0}/1.csv", "--joint", "--estimator", "{0}/unit.estimator"],
            "--estimator is for recordings diagnosed one by one",
        ),
        (["train", "-o", "{0}/unit.model"], ".estimator"),
        (["train", "-o", "{0}/unit.estimator"], "--force"),
        (["train", "-o", "{0}/new.estimator", "--epochs", "0"], "--epochs"),
        (["train", "-o", "{0}/new.estimator", "--adc-bits", "many"], "exact"),
        (["train", "-o", "{0}/new.estimator", "--channels", "sped"], "did you mean 'speed_rad_s'"),
        (["train", "-o", "{0}/new.estimator", "--nuisance", "lod"], "did you mean 'load'"),
    ],
)
def test_wrong_arguments_are_refused_in_one_line(
    folder: Path, arguments: list[str], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([argument.format(folder) for argument in arguments]) == 2
    captured = capsys.readouterr()
    assert complaint in captured.err
    assert captured.err.count("\n") == 1
    assert captured.out == ""


FACTS = {
    "simulations": 0,
    "simulation_seconds": 0.0,
    "epochs": 0,
    "training_seconds": 0.0,
    "seed": 0,
    "notes": [],
    "judgement": {
        "draws": 0,
        "median_error_percent": 0.0,
        "p95_error_percent": 0.0,
        "not_believed": 0.0,
        "coverage95": {},
        "rank_chi2": {},
        "rank_chi2_limit": 0.0,
    },
}
"""Data of a training that did not take place."""


def trained_by(folder: Path, monkeypatch: pytest.MonkeyPatch, meanwhile: Callable[[Path], object]) -> None:
    """Replace training: it returns the estimator in `folder` after `meanwhile(folder of simulations)`."""

    def train(_: object, __: object, place: Path, **___: object) -> Estimator:
        place.mkdir()
        meanwhile(place)
        return replace(Estimator.load(folder / "unit.estimator"), facts=FACTS)

    monkeypatch.setattr("emaphm.amortized.train.train_estimator", train)


@pytest.mark.parametrize("force", [False, True])
def test_a_file_created_during_training_is_replaced_only_by_force(
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    force: bool,
) -> None:
    out, later = tmp_path / "new.estimator", tmp_path / "new-2.estimator"
    trained_by(folder, monkeypatch, lambda _: out.write_text("of another training"))
    assert main(["train", "-o", str(out), "--json", *(["--force"] if force else [])]) == 0
    streams = capsys.readouterr()
    written = out if force else later
    assert json.loads(streams.out)["estimator"] == str(written)
    assert Estimator.load(written).setup.actuator == THESIS
    if not force:
        assert out.read_text() == "of another training"
        (note,) = json.loads(streams.out)["notes"]
        assert (
            note == f"{out} has appeared during the training and is not replaced; the estimator is in {later}"
        )
    assert streams.err == ""


def test_an_estimator_that_cannot_be_written_to_its_file_is_saved_elsewhere(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    away, kept = tmp_path / "away", tmp_path / "kept"
    away.mkdir()
    trained_by(folder, monkeypatch, lambda _: away.rmdir())
    assert main(["train", "-o", str(away / "new.estimator"), "--folder", str(kept)]) == 2
    assert f"the estimator is in {kept / 'new.estimator'}: copy it from there" in capsys.readouterr().err
    assert Estimator.load(kept / "new.estimator").setup.actuator == THESIS


def test_simulations_that_another_training_uses_are_not_removed(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with ExitStack() as other_training:

        def other_begins(place: Path) -> None:
            begun = training_folder(place, RecordingSetup.of(THESIS, Chirp()), 0)
            other_training.enter_context(begun.locked())

        trained_by(folder, monkeypatch, other_begins)
        assert main(["train", "-o", str(tmp_path / "new.estimator")]) == 0
        assert (tmp_path / "new.estimator.training" / "training.json").exists()


@pytest.mark.usefixtures("any_delay_shows")
def test_json_names_the_method(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command_line = [
        "diagnose",
        f"{folder}/0.csv",
        "--estimator",
        f"{folder}/unit.estimator",
        "--fast",
        "--json",
    ]
    assert main(command_line) == 0
    values = json.loads(capsys.readouterr().out)
    assert values["method"] == "estimator"
    np.testing.assert_allclose(values["k"][0], TRUTH.friction, atol=1e-3)


@pytest.mark.usefixtures("any_delay_shows")
def test_a_batch_is_diagnosed_by_the_estimator(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command_line = [
        "diagnose",
        f"{folder}/0.csv",
        f"{folder}/1.csv",
        "--estimator",
        f"{folder}/unit.estimator",
    ]
    assert main([*command_line, "--fast", "--json", "--workers", "1", "-o", f"{folder}/batch"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [line["method"] for line in lines] == ["estimator"] * 2


@pytest.mark.usefixtures("any_delay_shows")
def test_an_estimator_replaced_during_a_batch_does_not_diagnose(folder: Path, tmp_path: Path) -> None:
    setup = RecordingSetup.of(THESIS, Chirp())
    file, files = tmp_path / "unit.estimator", [folder / "0.csv", folder / "1.csv"]
    settings = DiagnosisSettings(estimator=str(file), fast=True)
    shutil.copy(folder / "unit.estimator", file)
    running = diagnose_all(files, THESIS, settings, workers=1, folder=tmp_path / "out")
    next(running)
    constant_estimator(setup, setup.space.points(Faults(friction=0.6).vector), 0.02).save(file)
    (replaced,) = running
    assert "unit.estimator: has changed since the work began" in replaced.error
    shutil.copy(folder / "unit.estimator", file)
    repeated = [
        outcome.values["k"][0]
        for outcome in diagnose_all(files, THESIS, settings, workers=1, folder=tmp_path / "out")
    ]
    np.testing.assert_allclose(repeated, TRUTH.friction, atol=1e-3)


def test_another_estimator_changes_the_key_of_the_results(folder: Path) -> None:
    first = DiagnosisSettings(estimator=str(folder / "unit.estimator")).to_dict()
    setup = short_setup()
    constant_estimator(setup, np.zeros(10)).save(folder / "other.estimator")
    assert first != DiagnosisSettings(estimator=str(folder / "other.estimator")).to_dict()
