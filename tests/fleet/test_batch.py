"""Batches of recordings: results equal those of single diagnoses, in the order of the files."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from cases import THESIS
from emaphm.actuator import COMPONENTS
from emaphm.cli import main
from emaphm.diagnosis import diagnose
from emaphm.errors import ExecutionError, MethodError, RecordingError
from emaphm.fleet import BatchResult, DiagnosisSettings, diagnose_all, recording_files
from emaphm.fleet import batch as batch_module
from emaphm.recording import read_recording

from .files import QUICK, written

COUNT = 4


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Return the files of `COUNT` recordings."""
    return written(tmp_path_factory.mktemp("made") / "days", COUNT)


@pytest.fixture
def folder(recordings: list[Path], tmp_path: Path) -> Path:
    """Return a folder of recordings that a test may change."""
    return Path(shutil.copytree(recordings[0].parent, tmp_path / "days"))


def untimed(results: list[BatchResult]) -> list[dict[str, Any]]:
    return [{key: value for key, value in result.values.items() if key != "seconds"} for result in results]


@pytest.mark.usefixtures("warm_workers")
def test_results_of_a_batch_equal_single_diagnoses_with_any_number_of_workers(recordings: list[Path]) -> None:
    order = [recordings[2], recordings[0], recordings[3], recordings[1]]
    alone = [
        diagnose(read_recording(path, THESIS), THESIS, max_corrections=0, nuisances=()).to_dict()
        for path in order
    ]
    expected = untimed([BatchResult(values) for values in alone])
    progress: list[tuple[int, int]] = []
    here = list(
        diagnose_all(
            order, THESIS, QUICK, workers=1, on_file=lambda done, total: progress.append((done, total))
        )
    )
    assert untimed(here) == expected
    assert progress == [(done, COUNT) for done in range(COUNT + 1)]
    assert untimed(list(diagnose_all(order, THESIS, QUICK, workers=2))) == expected


def test_a_broken_file_is_reported_and_the_other_files_are_diagnosed(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "day1.csv").write_text("time_s,command_rad\n0,nothing\n", encoding="utf-8")
    (folder / "readme.txt").write_text("No recording.", encoding="utf-8")
    (folder / ".day9.csv").write_text("Hidden.", encoding="utf-8")
    arguments = ["diagnose", str(folder), "--no-correction", "--nuisance", "none", "--workers", "1"]
    assert main([*arguments, "--json"]) == 2
    out, err = capsys.readouterr()
    lines = [json.loads(line) for line in out.splitlines()]
    assert [document["recording"] for document in lines] == [
        str(folder / f"day{i}.csv") for i in range(COUNT)
    ]
    assert [sorted(document) == ["error", "recording"] for document in lines] == [False, True, False, False]
    assert lines[1]["error"].startswith(f"{folder / 'day1.csv'}: ")
    assert err.startswith(
        f"emaphm: 1 of {COUNT} recordings could not be diagnosed, the others are done; the first"
    )
    assert err.count("\n") == 1
    assert main(arguments) == 2
    table = capsys.readouterr().out
    assert table.count(".csv  ") == COUNT
    assert f"{COUNT} recordings: " in table
    assert "; 1 could not be diagnosed." in table


def test_the_message_states_that_no_recording_could_be_diagnosed(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for names, words in (
        ("day0.csv", "nothing could be"),
        ("day0.csv day1.csv", "none of 2 recordings could be"),
    ):
        files = [str(folder / name) for name in names.split()]
        assert main(["diagnose", *files, "--by", "absent", "--workers", "1"]) == 2
        assert capsys.readouterr().err.startswith(f"emaphm: {words} diagnosed")


@pytest.mark.parametrize(("verdict", "shown"), [("healthy", "none"), ("cannot tell", "cannot tell")])
def test_the_table_distinguishes_healthy_recordings_from_cannot_tell(verdict: str, shown: str) -> None:
    values = {
        "recording": "a.csv",
        "explained": True,
        "relative_residual": 0.01,
        "moves": True,
        "faults": {name: {"value": 0.0, "verdict": verdict} for name in COMPONENTS},
        **dict.fromkeys(("suspected", "laws", "reasons", "notes"), ()),
    }
    assert BatchResult(values).row.cells[1:4] == ("yes", "1.0 %", shown)


def test_a_single_file_gives_the_output_of_a_single_diagnosis(
    recordings: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--no-correction", "--nuisance", "none"]
    assert main(["diagnose", str(recordings[1]), *options]) == 0
    alone = capsys.readouterr().out
    assert "95 % interval" in alone
    assert main(["diagnose", *map(str, recordings[:2]), "--workers", "1", *options]) == 0
    assert "95 % interval" not in capsys.readouterr().out


def test_stored_results_are_not_computed_again(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, files = tmp_path / "out", recording_files([folder])
    begun = diagnose_all(files, THESIS, QUICK, workers=1, folder=out)
    first = [next(begun), next(begun)]
    begun.close()
    progress: list[int] = []

    def again() -> list[BatchResult]:
        progress.clear()
        return list(
            diagnose_all(
                files, THESIS, QUICK, workers=1, folder=out, on_file=lambda done, _: progress.append(done)
            )
        )

    results = again()
    assert progress == [2, 3, 4]
    # A stored result is unchanged, its seconds included.
    assert [result.values for result in results[:2]] == [result.values for result in first]
    # A changed file is diagnosed again, and a broken file in every run.
    shutil.copy(files[0], files[2])
    files[3].write_text("broken", encoding="utf-8")
    changed = again()
    assert progress == [2, 3, 4]
    assert changed[2].values["k"] == results[0].values["k"]
    assert changed[3].error
    again()
    assert progress == [3, 4]
    with pytest.raises(ExecutionError, match=r"other settings: 'settings.seed' \(0 there, 1 here\); give"):
        diagnose_all(files, THESIS, replace(QUICK, seed=1), folder=out)
    monkeypatch.setattr(batch_module, "revision", lambda: "0123456789ab")
    with pytest.raises(
        ExecutionError, match=r"made by another version of emaphm \(.*; this is 0123456789ab\)"
    ):
        diagnose_all(files, THESIS, QUICK, folder=out)


def test_no_result_is_stored_for_a_file_that_is_replaced_during_the_batch(
    folder: Path, tmp_path: Path
) -> None:
    out, files = tmp_path / "out", recording_files([folder])[:2]
    right = files[1].read_bytes()
    running = diagnose_all(files, THESIS, QUICK, workers=1, folder=out)
    next(running)
    shutil.copy(folder / "day3.csv", files[1])
    (replaced,) = running
    assert "day1.csv: has changed since the batch began; give the same command again" in replaced.error
    files[1].write_bytes(right)
    alone = diagnose(read_recording(files[1], THESIS), THESIS, max_corrections=0, nuisances=()).to_dict()
    again = list(diagnose_all(files, THESIS, QUICK, workers=1, folder=out))
    assert untimed(again)[1] == untimed([BatchResult(alone)])[0]


def test_a_file_that_appears_during_the_batch_is_diagnosed_in_the_next_run(
    folder: Path, tmp_path: Path
) -> None:
    out, files = tmp_path / "out", recording_files([folder])[:2]
    away = files[1].rename(tmp_path / "away.csv")
    running = diagnose_all(files, THESIS, QUICK, workers=1, folder=out)
    next(running)
    shutil.copy(away, files[1])
    assert [bool(result.error) for result in running] == [True]
    files[1].unlink()
    again = diagnose_all(files, THESIS, QUICK, workers=1, folder=out)
    assert [bool(result.error) for result in again] == [False, True]


def test_a_second_batch_in_the_same_folder_is_refused(recordings: list[Path], tmp_path: Path) -> None:
    running = diagnose_all(recordings, THESIS, QUICK, workers=1, folder=tmp_path / "out")
    next(running)
    with pytest.raises(ExecutionError, match="another batch of diagnoses is running in"):
        next(diagnose_all(recordings, THESIS, QUICK, workers=1, folder=tmp_path / "out"))
    running.close()


def test_a_folder_with_other_content_is_refused(recordings: list[Path], tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("Important.", encoding="utf-8")
    with pytest.raises(ExecutionError, match="holds something else than a batch of diagnoses"):
        diagnose_all(recordings, THESIS, QUICK, folder=tmp_path)
    (tmp_path / "settings.json").write_text("{", encoding="utf-8")
    with pytest.raises(ExecutionError, match=r"settings\.json: cannot be read \("):
        diagnose_all(recordings, THESIS, QUICK, folder=tmp_path)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--report", "r.html"], "--report is of one recording; give one file, without --by, --joint"),
        (["--healthy", "h.json"], "--healthy is for one recording; give one file, without --by, --joint"),
        (["--workers", "0"], "--workers 0: give 1 or more"),
        (["--workers", "2", "--scheduler", "tcp://127.0.0.1:1"], "exclude each other"),
        (["--method", "hybird"], "did you mean 'hybrid'?"),
        (["--nuisance", "lode"], "unknown nuisance 'lode' (did you mean 'load'?)"),
        (["--joint", "--out", "results"], "--out is for recordings diagnosed one by one"),
        (["--joint", "--method", "de"], "--method is for recordings diagnosed one by one"),
    ],
)
def test_invalid_options_are_refused_before_the_first_diagnosis(
    recordings: list[Path], capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert main(["diagnose", *map(str, recordings), *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert message in err
    assert err.count("\n") == 1


def test_folders_without_recordings_and_files_named_twice_are_refused(
    recordings: list[Path], tmp_path: Path
) -> None:
    with pytest.raises(RecordingError, match=r"is a folder without recordings \(\.csv"):
        recording_files([tmp_path])
    with pytest.raises(RecordingError, match=r"day0\.csv: is named twice"):
        recording_files([recordings[0].parent, recordings[0]])


def test_settings_are_checked_before_the_first_file(recordings: list[Path]) -> None:
    with pytest.raises(MethodError, match="unknown model"):
        diagnose_all(recordings, THESIS, DiagnosisSettings(model="best"))
