"""Batches of earlier recordings diagnosed by an estimator: number, speed, and check of the folder."""

import sys
from pathlib import Path

import numpy as np
import pytest

from amortized.toys import constant_estimator
from emaphm.actuator import NAMES, Actuator, Chirp
from emaphm.amortized.recording_setup import RecordingSetup
from emaphm.errors import StudyError
from emaphm.study.estimators.__main__ import main
from emaphm.study.estimators.batches import answered
from emaphm.study.estimators.cases import GROUPS, RecordingCase, of_base_setting, of_multiple, of_unlike
from emaphm.study.estimators.tables import alarms_table, coverage_table
from emaphm.study.estimators.trial import METHODS

SETUP = RecordingSetup.of(Actuator.thesis(), Chirp())
CENTRE = 0.5 * np.ones(SETUP.space.dimensions)


@pytest.fixture(scope="module")
def estimator(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("estimator") / "unit.estimator"
    constant_estimator(SETUP, CENTRE, 0.1).save(path)
    return path


def kept(folder: Path, count: int, blocks: int) -> Path:
    for number in range(2):
        np.savez(
            folder / f"shard-{number:05}.npz",
            points=np.tile(CENTRE, (count, 1)).astype(np.float32),
            rows=np.zeros((count, 2, blocks), np.float32),
        )
    return folder


def test_the_requested_number_of_recordings_is_diagnosed(estimator: Path, tmp_path: Path) -> None:
    line = answered(estimator, kept(tmp_path, 3, 1250), most=5)
    assert line.startswith("5 recordings in ")
    assert "per second and core; error 0.0" in line
    assert "coverage 100.0 to 100.0 %" in line


def test_folders_of_other_work_are_refused(estimator: Path, tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="no simulations; give the --folder"):
        answered(estimator, tmp_path, most=5)
    with pytest.raises(StudyError, match="give its own folder"):
        answered(estimator, kept(tmp_path, 1, 7), most=5)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("--groups random bogus", "invalid choice: 'bogus'"),
        ("--share 0", "--share 0: give more than 0, up to 1"),
    ],
)
def test_recordings_that_do_not_exist_are_refused(
    arguments: str, message: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["estimators", "unit.estimator", *arguments.split()])
    with pytest.raises(SystemExit):
        main()
    assert message in capsys.readouterr().err


def test_rates_of_groups_that_were_left_out_are_no_numbers() -> None:
    healthy = {"moves": True, "degraded": [False] * len(NAMES)}
    table = alarms_table([(RecordingCase("healthy", "healthy", (), None, 0), METHODS[0], healthy)])
    assert "| 0.0 % | – | – |" in table


def test_all_groups_have_a_name() -> None:
    channels = ("current_A",)
    cases = (*of_base_setting(channels, 0.01), *of_multiple(channels), *of_unlike(channels, 0.05))
    assert {case.group for case in cases} == set(GROUPS)


def test_coverage_is_the_share_of_intervals_with_the_true_value_by_component() -> None:
    case = RecordingCase("random", "random", (0.5,) * len(NAMES), None, 0)
    outside = {"moves": True, "covered": [name != "gain" for name in NAMES]}
    within = {"moves": True, "covered": [True] * len(NAMES)}
    at_rest = {"moves": False, "covered": [False] * len(NAMES)}
    results = [(case, METHODS[0], result) for result in (outside, within, at_rest)]
    *_, row = coverage_table(results).splitlines()
    cells = [cell.strip() for cell in row.strip("|").split("|")]
    assert cells[:2] == ["random, 2", METHODS[0]]
    assert dict(zip(NAMES, cells[2:], strict=True)) == dict.fromkeys(NAMES, "100.0 %") | {"gain": "50.0 %"}
