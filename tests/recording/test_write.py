"""Writing: exact to the last bit, never partial, and no file is overwritten without `force`."""

import os
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from emaphm.actuator import Actuator
from emaphm.actuator.reading import Reading
from emaphm.output_files import check_writable, written_whole
from emaphm.recording import Recording, read_recording, write_recording
from emaphm.recording.io.limits import ReadLimits

from .conftest import Columns, Refusal

ENDINGS = ("csv", "parquet")
FINITE = arrays(np.float64, 60, elements=st.floats(allow_nan=False, allow_infinity=False))


@pytest.mark.parametrize("ending", ENDINGS)
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(command=FINITE.filter(np.any), current=FINITE, extra=arrays(np.float64, 60))
def test_a_recording_read_back_is_the_same_to_the_last_bit(
    tmp_path: Path,
    thesis: Actuator,
    ending: str,
    command: np.ndarray,
    current: np.ndarray,
    extra: np.ndarray,
) -> None:
    columns = {
        "time_s": np.arange(60) / 3e3,
        "command_rad": command,
        "current_A": current,
        "torque, of the motor": extra,
    }
    path = tmp_path / f"rec.{ending}"
    write_recording(Recording(columns), path, force=True)
    # In this process: another test checks the process for each file, which takes 0.2 s.
    # No actuator makes such signals: outliers are kept here.
    as_it_is = thesis.model_copy(update={"reading": Reading(outliers=False)})
    recording = read_recording(path, as_it_is, limits=ReadLimits(isolated=False))
    assert recording.names == tuple(columns)
    for name, values in columns.items():
        np.testing.assert_array_equal(recording[name], values)
        zeros = values == 0  # an equality does not compare the sign of 0
        np.testing.assert_array_equal(np.signbit(recording[name][zeros]), np.signbit(values[zeros]))


LABELS: dict[str, float | str] = {
    "serial": "42",
    "long": "12345678901234567890",
    "form": "1.10",
    "odd": "inf",
    "rig": "left",
    "run": 42.0,
}


@pytest.mark.parametrize("ending", ENDINGS)
def test_labels_of_digits_stay_texts(columns: Columns, tmp_path: Path, thesis: Actuator, ending: str) -> None:
    path = tmp_path / f"rec.{ending}"
    write_recording(Recording(columns, labels=LABELS), path)
    assert read_recording(path, thesis, limits=ReadLimits(isolated=False)).labels == LABELS


def test_numbers_in_quotes_stay_numbers_if_a_program_quotes_all_values(
    columns: Columns, tmp_path: Path, thesis: Actuator
) -> None:
    table = pl.DataFrame({**columns, "run": np.full(len(columns["time_s"]), 42.0)})
    table.write_csv(tmp_path / "rec.csv", quote_style="always")
    recording = read_recording(tmp_path / "rec.csv", thesis, limits=ReadLimits(isolated=False))
    assert recording.labels == {"run": 42.0}


@pytest.mark.parametrize("name", ["rec.csv", "REC.CSV", "rec.Parquet"])
def test_only_the_file_is_left(columns: Columns, tmp_path: Path, name: str) -> None:
    write_recording(Recording(columns), tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_written_file_has_the_usual_permissions(columns: Columns, tmp_path: Path) -> None:
    (tmp_path / "usual").touch()
    write_recording(Recording(columns), tmp_path / "rec.csv")
    assert (tmp_path / "rec.csv").stat().st_mode == (tmp_path / "usual").stat().st_mode


def test_an_existing_file_is_replaced_only_by_force(
    columns: Columns, tmp_path: Path, refusal: Refusal
) -> None:
    path = tmp_path / "rec.csv"
    path.write_text("precious")
    text = refusal(lambda: write_recording(Recording(columns), path))
    assert str(path) in text
    assert "--force" in text
    assert path.read_text() == "precious"
    write_recording(Recording(columns), path, force=True)
    assert path.read_text().startswith("time_s,command_rad")


def test_a_failure_while_writing_leaves_only_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "rec.csv"
    path.write_text("precious")

    def fail() -> None:
        with written_whole(path) as temporary:
            temporary.write_text("half of")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert path.read_text() == "precious"
    assert list(tmp_path.iterdir()) == [path]


def test_a_system_error_while_writing_is_reported(tmp_path: Path, refusal: Refusal) -> None:
    path = tmp_path / "rec.csv"

    def fail() -> None:
        with written_whole(path):
            raise OSError(28, "No space left on device")

    text = refusal(fail)
    assert str(path) in text
    assert "No space left on device" in text
    assert list(tmp_path.iterdir()) == []


def test_a_folder_removed_while_writing_is_reported_with_the_remedy(tmp_path: Path, refusal: Refusal) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()

    def fail() -> None:
        with written_whole(folder / "rec.csv") as temporary:
            folder.rmdir()
            temporary.write_text("rows")

    text = refusal(fail)
    assert text.endswith("its folder is gone; create it again, or give another place")
    assert "free space" not in text


def test_a_symbolic_link_stays_a_link(columns: Columns, tmp_path: Path) -> None:
    target, link = tmp_path / "target.csv", tmp_path / "link.csv"
    target.touch()
    link.symlink_to(target)
    write_recording(Recording(columns), link, force=True)
    assert link.is_symlink()
    assert target.read_text().startswith("time_s")


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("rec.xlsx", ["'.xlsx'", ".csv or .parquet"]),
        ("rec.mat", ["'.mat'", ".csv or .parquet"]),
        ("rec", ["no ending", ".csv or .parquet"]),
        ("missing/rec.csv", ["missing' does not exist", "create it"]),
        ("file.txt/rec.csv", ["file.txt' is not a folder"]),
        ("folder.csv", ["is a folder", "name of a file"]),
        ("pipe.csv", ["not a regular file", "another name"]),
        (f"{'n' * 300}.csv", ["name too long", "give another"]),
    ],
)
@pytest.mark.parametrize("force", [False, True])
def test_an_impossible_output_is_refused(
    columns: Columns, tmp_path: Path, refusal: Refusal, name: str, force: bool, expected: list[str]
) -> None:
    (tmp_path / "file.txt").touch()
    (tmp_path / "folder.csv").mkdir()
    os.mkfifo(tmp_path / "pipe.csv")
    before = sorted(tmp_path.iterdir())
    text = refusal(lambda: write_recording(Recording(columns), tmp_path / name, force=force))
    assert text.startswith(str(tmp_path / name))
    for part in expected:
        assert part in text
    assert sorted(tmp_path.iterdir()) == before


def test_a_check_without_writing_leaves_no_file(tmp_path: Path) -> None:
    check_writable(tmp_path / "report.html")
    check_writable(tmp_path / "report.HTML", endings=(".html",))
    assert list(tmp_path.iterdir()) == []


def test_a_read_only_folder_is_refused(refusal: Refusal) -> None:
    kernel = Path("/proc/self")
    if not kernel.is_dir():
        pytest.skip("only Linux has a folder in which not even root may write")
    text = refusal(lambda: check_writable(kernel / "report.html"))
    assert "cannot be written there" in text
    assert "give another name or folder" in text


@pytest.mark.parametrize("ending", ENDINGS)
def test_instants_are_read_back_with_an_actuator_that_samples_instants(
    columns: Columns, tmp_path: Path, thesis: Actuator, ending: str
) -> None:
    path = tmp_path / f"rec.{ending}"
    write_recording(Recording(columns, "instant"), path)
    sampled = thesis.changed({"channels.sampling": "instant"})
    assert read_recording(path, sampled, limits=ReadLimits(isolated=False)).sampling == "instant"
    assert read_recording(path, thesis, limits=ReadLimits(isolated=False)).sampling == "mean"
