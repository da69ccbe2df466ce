"""Reading of files with foreign names, in all formats, and refusal of unreadable files."""

import struct
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
import scipy.io
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from emaphm.actuator import Actuator
from emaphm.actuator.channels import Channels
from emaphm.errors import RecordingError
from emaphm.recording import read_recording
from emaphm.recording.io.limits import ReadLimits
from emaphm.recording.io.mat_file import read_mat

from .conftest import Columns, Refusal

ENDINGS = ("csv", "parquet", "mat")
NAMES = {"time_s": "t", "command_rad": "qg", "position_rad": "qm", "current_A": "vir"}


def _save(columns: Columns, path: Path) -> Path:
    """Write columns with another library, without the writer of emaphm."""
    ending = path.suffix.lower()
    if ending == ".csv":
        table = np.column_stack(list(columns.values()))
        np.savetxt(path, table, delimiter=",", header=",".join(columns), comments="", fmt="%.17g")
    elif ending == ".parquet":
        pl.DataFrame(columns).write_parquet(path)
    else:
        scipy.io.savemat(path, columns, oned_as="column")
    return path


def _foreign(columns: Columns) -> Columns:
    return {NAMES.get(name, name): values for name, values in columns.items()}


@pytest.mark.parametrize("ending", [*ENDINGS, "CSV", "Parquet", "MAT"])
def test_schema_names_need_no_mapping(
    columns: Columns, tmp_path: Path, thesis: Actuator, ending: str
) -> None:
    path = _save(columns, tmp_path / f"rec.{ending}")
    recording = read_recording(path, thesis)
    assert (recording.source, recording.sampling) == (str(path), "mean")
    assert recording.names == tuple(columns)
    for name, values in columns.items():
        np.testing.assert_array_equal(recording[name], values)


@pytest.mark.parametrize("ending", ENDINGS)
def test_foreign_names_are_mapped_and_further_columns_are_kept(
    columns: Columns, tmp_path: Path, emps: Actuator, ending: str
) -> None:
    extra = np.linspace(0, 1, 2500)
    path = _save({**_foreign(columns), "humidity": extra}, tmp_path / f"rec.{ending}")
    recording = read_recording(str(path), emps)
    assert recording.sampling == "instant"
    assert set(recording.names) == {*columns, "humidity"}
    np.testing.assert_array_equal(recording["command_rad"], columns["command_rad"])
    np.testing.assert_array_equal(recording["humidity"], extra)


def test_a_file_with_schema_names_is_read_with_a_rig_that_has_foreign_names(
    columns: Columns, tmp_path: Path, emps: Actuator
) -> None:
    # Also without a channel that the rig's own files must hold.
    del columns["position_rad"]
    path = _save(columns, tmp_path / "rec.csv")
    np.testing.assert_array_equal(read_recording(path, emps)["current_A"], columns["current_A"])


def test_a_column_mapped_to_another_channel_is_not_used_by_its_schema_name(
    columns: Columns, tmp_path: Path, thesis: Actuator, refusal: Refusal
) -> None:
    rig = thesis.model_copy(update={"channels": Channels(position_rad="pos", angle_rad="position_rad")})
    path = _save(columns, tmp_path / "rec.csv")
    assert "no column 'pos'" in refusal(lambda: read_recording(path, rig))


def test_two_names_may_be_exchanged(columns: Columns, tmp_path: Path, thesis: Actuator) -> None:
    crossed = Channels(speed_rad_s="position_rad", position_rad="speed_rad_s")
    rig = thesis.model_copy(update={"channels": crossed})
    recording = read_recording(_save(columns, tmp_path / "rec.csv"), rig)
    np.testing.assert_array_equal(recording["speed_rad_s"], columns["position_rad"])
    np.testing.assert_array_equal(recording["position_rad"], columns["speed_rad_s"])


def test_a_mapped_name_takes_precedence_over_the_schema_name(
    columns: Columns, tmp_path: Path, thesis: Actuator
) -> None:
    rig = thesis.model_copy(update={"channels": Channels(current_A="raw")})
    path = _save({**columns, "raw": columns["current_A"] + 1}, tmp_path / "rec.csv")
    recording = read_recording(path, rig)
    np.testing.assert_array_equal(recording["current_A"], columns["current_A"] + 1)
    assert "raw" not in recording


def test_measured_data_agree_with_their_published_figures(emps_file: Path, emps: Actuator) -> None:
    recording = read_recording(emps_file, emps)
    # Figures from the description of the data set; the clock jitters by 1e-8 s.
    assert recording.samples == 24_841
    assert recording.sample_rate_hz == pytest.approx(1000.0, rel=1e-6)
    assert recording.sampling == "instant"
    assert set(recording.names) == set(NAMES)
    # Control law of the rig: u = kv (kp (command - position) - speed), far from its limit of 10 V.
    speed = np.gradient(recording["position_rad"], recording["time_s"])
    law = 243.45 * (160.18 * (recording["command_rad"] - recording["position_rad"]) - speed)
    # The differentiated encoder signal is noisy, so the law holds on average and not in each row.
    assert np.corrcoef(law, recording["current_A"])[0, 1] > 0.9


def test_unneeded_text_columns_are_left_out(columns: Columns, tmp_path: Path, thesis: Actuator) -> None:
    frame = pl.DataFrame(columns).with_columns(remark=pl.lit("quiet"), index=pl.lit(None))
    frame.write_csv(tmp_path / "rec.csv")
    frame.drop("index").write_parquet(tmp_path / "rec.parquet")
    assert "remark" not in read_recording(tmp_path / "rec.csv", thesis)
    assert "remark" not in read_recording(tmp_path / "rec.parquet", thesis)


@pytest.mark.parametrize(
    "dress",
    [
        lambda text: "\ufeff" + text,
        lambda text: text.replace(",", ", "),
        lambda text: text.replace("\n", "\r\n"),
        lambda text: "\n" + text + "\n\n\n",
        lambda text: text.rstrip("\n"),
        lambda text: text.replace("current_A", '"current_A"'),
        lambda text: text.replace("\n", ",\n"),
    ],
    ids=["byte order mark", "blanks", "Windows", "blank ends", "no last newline", "quotes", "trailing comma"],
)
def test_csv_dialects_of_other_programs_are_read(
    columns: Columns, tmp_path: Path, thesis: Actuator, dress: Callable[[str], str]
) -> None:
    path = _save(columns, tmp_path / "rec.csv")
    path.write_bytes(dress(path.read_text()).encode())
    recording = read_recording(path, thesis)
    for name, values in columns.items():
        np.testing.assert_array_equal(recording[name], values)


@pytest.mark.parametrize("name", ["rec[1].csv", "rec*.parquet", "~rec.csv"])
def test_file_names_are_taken_literally(
    columns: Columns, tmp_path: Path, thesis: Actuator, name: str
) -> None:
    assert read_recording(_save(columns, tmp_path / name), thesis).samples == 2500


def test_other_number_types_in_parquet_files_are_read(
    columns: Columns, tmp_path: Path, thesis: Actuator
) -> None:
    frame = pl.DataFrame(columns).with_columns(
        pl.col("current_A").cast(pl.Float32), pl.col("temperature_K").cast(pl.Int16)
    )
    frame.write_parquet(tmp_path / "rec.parquet")
    recording = read_recording(tmp_path / "rec.parquet", thesis)
    np.testing.assert_allclose(recording["current_A"], columns["current_A"], rtol=1e-7)
    np.testing.assert_array_equal(recording["temperature_K"], 293.0)


@pytest.mark.parametrize("options", [{"do_compression": True}, {"format": "4"}, {"oned_as": "row"}])
def test_all_versions_of_mat_files_are_read(
    columns: Columns, tmp_path: Path, thesis: Actuator, options: dict[str, Any]
) -> None:
    path = tmp_path / "rec.mat"
    scipy.io.savemat(path, {**columns, "kp": 160.18, "gains": np.ones(10)}, **options)
    recording = read_recording(path, thesis)
    np.testing.assert_array_equal(recording["current_A"], columns["current_A"])
    assert "kp" not in recording
    assert "gains" not in recording


def _mat_element(kind: int, content: bytes) -> bytes:
    return struct.pack("<II", kind, len(content)) + content + b"\0" * (-len(content) % 8)


def test_a_mat_file_with_a_string_object_is_read(columns: Columns, tmp_path: Path, thesis: Actuator) -> None:
    path = tmp_path / "rec.mat"
    scipy.io.savemat(path, dict(columns))
    # Only MATLAB writes these: class 17, a name, the type system, the class, and an object number.
    numbers = _mat_element(6, struct.pack("<II", 13, 0)) + _mat_element(5, struct.pack("<ii", 6, 1))
    numbers += _mat_element(1, b"") + _mat_element(6, struct.pack("<6I", 0xDD000000, 2, 1, 1, 1, 1))
    parts = [_mat_element(6, struct.pack("<II", 17, 0))]
    parts += [_mat_element(1, text) for text in (b"operator", b"MCOS", b"string")]
    path.write_bytes(path.read_bytes() + _mat_element(14, b"".join([*parts, _mat_element(14, numbers)])))
    # SciPy gives objects no name.
    assert scipy.io.loadmat(path)["None"][0][0] == b"operator"
    np.testing.assert_array_equal(read_recording(path, thesis)["current_A"], columns["current_A"])
    assert "is not numeric" in read_mat(path, ReadLimits()).unusable["operator"]


def _save_mat73(columns: Columns, path: Path) -> Path:
    h5py = pytest.importorskip("h5py", reason="MATLAB 7.3 files need h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in columns.items():
            file[name] = values[None, :]
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
        file["kp"] = [[160.18]]
        file["remark"] = np.full((1, 2500), 65, dtype=np.uint16)
        file["remark"].attrs["MATLAB_class"] = np.bytes_("char")
        file["note"] = np.full((1, 2500), 65, dtype=np.uint16)
        file["note"].attrs["MATLAB_class"] = "char"
        file.create_group("settings").attrs["MATLAB_class"] = np.bytes_("struct")
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    return path


def test_a_mat_file_of_version_7_3_is_read(columns: Columns, tmp_path: Path, thesis: Actuator) -> None:
    recording = read_recording(_save_mat73(columns, tmp_path / "rec.mat"), thesis)
    assert set(recording.names) == set(columns)
    for name, values in columns.items():
        np.testing.assert_array_equal(recording[name], values)


def test_a_mat_file_of_version_7_3_without_h5py_names_the_package_to_install(
    columns: Columns, tmp_path: Path, thesis: Actuator, refusal: Refusal, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = _save_mat73(columns, tmp_path / "rec.mat")
    monkeypatch.setitem(sys.modules, "h5py", None)
    text = refusal(lambda: read_recording(path, thesis))
    assert str(path) in text
    assert "pip install h5py" in text


def test_a_truncated_mat_file_of_version_7_3_is_refused(
    columns: Columns, tmp_path: Path, thesis: Actuator, refusal: Refusal
) -> None:
    path = _save_mat73(columns, tmp_path / "rec.mat")
    path.write_bytes(path.read_bytes()[:4000])
    assert "not a readable .mat file" in refusal(lambda: read_recording(path, thesis))


def _mat_with(**variables: object) -> Callable[[Columns, Path], Path]:
    def save(columns: Columns, folder: Path) -> Path:
        path = folder / "rec.mat"
        scipy.io.savemat(path, {**columns, **variables})
        return path

    return save


def _csv_text(change: Callable[[list[str]], list[str]]) -> Callable[[Columns, Path], Path]:
    """Return a function that saves a CSV file with its lines changed; the header is line 0."""

    def save(columns: Columns, folder: Path) -> Path:
        path = _save(columns, folder / "rec.csv")
        path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")
        return path

    return save


def _line(number: int, change: Callable[[str], str]) -> Callable[[Columns, Path], Path]:
    return _csv_text(lambda lines: [*lines[:number], change(lines[number]), *lines[number + 1 :]])


def _raw(name: str, content: bytes) -> Callable[[Columns, Path], Path]:
    def save(_: Columns, folder: Path) -> Path:
        path = folder / name
        path.write_bytes(content)
        return path

    return save


def _cut(ending: str, keep: float) -> Callable[[Columns, Path], Path]:
    def save(columns: Columns, folder: Path) -> Path:
        path = _save(columns, folder / f"rec.{ending}")
        content = path.read_bytes()
        path.write_bytes(content[: int(len(content) * keep)])
        return path

    return save


def _folder(_: Columns, folder: Path) -> Path:
    path = folder / "rec.csv"
    path.mkdir()
    return path


def _without(names: tuple[str, ...], ending: str) -> Callable[[Columns, Path], Path]:
    return lambda columns, folder: _save(
        {key: values for key, values in columns.items() if key not in names}, folder / f"rec.{ending}"
    )


def _parquet_with(**expressions: pl.Expr) -> Callable[[Columns, Path], Path]:
    def save(columns: Columns, folder: Path) -> Path:
        path = folder / "rec.parquet"
        pl.DataFrame(columns).with_columns(**expressions).write_parquet(path)
        return path

    return save


def _twice_in_mat(columns: Columns, folder: Path) -> Path:
    first, second = _save(columns, folder / "rec.mat"), _save(columns, folder / "other.mat")
    first.write_bytes(first.read_bytes() + second.read_bytes()[128:])  # 128 bytes of header
    return first


NOISE = np.random.default_rng(0).bytes(4000)

BAD: dict[str, tuple[Callable[[Columns, Path], Path], list[str]]] = {
    "missing file": (lambda _, folder: folder / "rec.csv", ["no such file", "check the path"]),
    "below a file": (
        lambda columns, folder: _save(columns, folder / "a.csv") / "rec.csv",
        ["rec.csv", "check the path"],
    ),
    "folder": (_folder, ["is a folder", "give a file"]),
    "unknown ending": (_raw("rec.xlsx", b"x"), ["'.xlsx'", ".csv, .parquet, .mat", "convert"]),
    "no ending": (_raw("rec", b"x"), ["no ending", ".csv, .parquet, .mat"]),
    **{f"empty {end}": (_raw(f"rec.{end}", b""), ["file is empty", "again"]) for end in ENDINGS},
    **{f"binary {end}": (_raw(f"rec.{end}", NOISE), ["not a readable", "again"]) for end in ENDINGS},
    **{f"text as {end}": (_raw(f"rec.{end}", b"a,b\n1,2\n" * 99), ["not a readable"]) for end in ENDINGS[1:]},
    **{f"cut {end}": (_cut(end, 0.6), ["not a readable", "cut short"]) for end in ENDINGS[1:]},
    "blank csv": (_raw("rec.csv", b"\n \n\n"), ["not a readable CSV"]),
    "header alone": (_csv_text(lambda lines: lines[:1]), ["too short: 0 rows"]),
    "no column": (
        lambda columns, folder: _save({"Current_A": columns["current_A"]}, folder / "rec.csv"),
        ["no column 'time_s'", "[channels]", 'time_s = "that name"'],
    ),
    **{
        f"no response {end}": (
            _without(("current_A", "position_rad", "speed_rad_s"), end),
            ["no column 'current_A'", "position_rad, speed_rad_s", "[channels]"],
        )
        for end in ENDINGS
    },
    "misspelt": (
        _line(0, lambda line: line.replace("time_s", "times")),
        ["'time_s'", "did you mean 'times'?"],
    ),
    "semicolons": (
        _csv_text(lambda lines: [x.replace(",", ";") for x in lines]),
        ["separated by ';'", "commas"],
    ),
    "semicolons and decimal commas": (
        _csv_text(lambda lines: [x.replace(",", ";").replace(".", ",") for x in lines]),
        ["separated by ';'", "points in numbers"],
    ),
    "a line before the header": (
        _csv_text(lambda lines: ["# logger 1.2", *lines]),
        ["the first line, '# logger 1.2', is no header of the 6 columns", "take out"],
    ),
    "shouted": (_line(0, lambda line: line.replace("time_s", "TIME_S")), ["did you mean 'TIME_S'?"]),
    "tabs": (_csv_text(lambda lines: [x.replace(",", "\t") for x in lines]), ["separated by tabs", "commas"]),
    "decimal comma": (_line(7, lambda line: line.replace(".", ",")), ["row 7 ", "header names 6", "points"]),
    "text in csv": (_line(12, lambda line: f"{line[:-3]}x"), ["'temperature_K'", "at row 12,", "no number"]),
    "units below the header": (_line(1, lambda _: "s,rad,rad,rad/s,A,K"), ["'time_s'", "'s' at row 1,"]),
    "empty cells": (
        _csv_text(
            lambda x: [f"{one.rpartition(',')[0]}," if 12 <= i < 16 else one for i, one in enumerate(x)]
        ),
        ["row 12 ", "'temperature_K'", "and 3 more"],
    ),
    "blank cells": (
        _csv_text(
            lambda x: [f'{one.rpartition(",")[0]}," "' if 12 <= i < 16 else one for i, one in enumerate(x)]
        ),
        ["row 12 ", "'temperature_K'", "is empty"],
    ),
    "blank line inside": (_csv_text(lambda x: [*x[:9], "", *x[9:]]), ["row 9 ", "'time_s'", "is empty"]),
    "same name twice": (
        _line(0, lambda line: line.replace("speed_rad_s", "current_A")),
        ["2 columns named 'current_A'", "rename"],
    ),
    "text in parquet": (
        _parquet_with(current_A=pl.lit("much")),
        ["'current_A'", "String", "row 1: 'much'", "as numbers"],
    ),
    "date in parquet": (
        _parquet_with(time_s=pl.from_epoch(pl.col("time_s").cast(int))),
        ["'time_s'", "Datetime", "as numbers"],
    ),
    "hole in parquet": (
        _parquet_with(
            current_A=pl.when(~pl.int_range(pl.len()).is_between(41, 50)).then(pl.col("current_A"))
        ),
        ["row 42 ", "'current_A'", "is empty"],
    ),
    "text in mat": (_mat_with(current_A="much"), ["'current_A'", "not numeric", "vector"]),
    "scalar in mat": (_mat_with(current_A=5.0), ["'current_A'", "a single number", "each sample"]),
    "matrix in mat": (_mat_with(current_A=np.ones((2500, 3))), ["'current_A'", "2500 × 3", "vector"]),
    "struct in mat": (_mat_with(current_A={"value": 1.0}), ["'current_A'", "a struct", "vector"]),
    "complex in mat": (_mat_with(current_A=np.full(2500, 1j)), ["'current_A'", "real numbers"]),
    "nothing in mat": (_mat_with(current_A=np.empty((0, 0))), ["'current_A'", "0 × 0"]),
    "lengths in mat": (
        _mat_with(current_A=np.ones(2400)),
        ["'current_A' has 2400 rows", "2500", "same length"],
    ),
    "twice in mat": (_twice_in_mat, ["columns named", "drop all but one"]),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_refused(
    columns: Columns, tmp_path: Path, thesis: Actuator, refusal: Refusal, name: str
) -> None:
    save, expected = BAD[name]
    path, limits = save(columns, tmp_path), ReadLimits(isolated=name == "cut parquet")
    text = refusal(lambda: read_recording(path, thesis, limits=limits))
    assert text.startswith(f"{path}: ")
    for part in expected:
        assert part in text


@pytest.mark.parametrize(
    ("renamed", "expected"),
    [
        ({"qg": "qq"}, ["no column 'qg'", "for command_rad", "did you mean 'qq'?", "correct the name"]),
        # The channel is not needed, but the description names it.
        ({"qm": "position"}, ["no column 'qm'", "for position_rad"]),
    ],
)
def test_a_described_channel_missing_from_the_file_is_an_error(
    columns: Columns,
    tmp_path: Path,
    emps: Actuator,
    refusal: Refusal,
    renamed: dict[str, str],
    expected: list[str],
) -> None:
    foreign = {renamed.get(name, name): values for name, values in _foreign(columns).items()}
    path = _save(foreign, tmp_path / "rec.csv")
    text = refusal(lambda: read_recording(path, emps))
    assert str(path) in text
    for part in [*expected, "[channels]"]:
        assert part in text


def test_errors_use_the_column_name_of_the_file(
    columns: Columns, tmp_path: Path, emps: Actuator, refusal: Refusal
) -> None:
    columns["current_A"][9] = np.inf
    path = _save(_foreign(columns), tmp_path / "rec.csv")
    text = refusal(lambda: read_recording(path, emps))
    assert "row 10 " in text
    assert "'vir' (current_A)" in text


@pytest.mark.parametrize("ending", ENDINGS)
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(keep=st.floats(0, 0.999))
def test_all_truncations_are_refused_with_a_value_error(
    columns: Columns, tmp_path: Path, thesis: Actuator, ending: str, keep: float
) -> None:
    path = _cut(ending, keep)({name: values[:60] for name, values in columns.items()}, tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            recording = read_recording(path, thesis, limits=ReadLimits(isolated=False))
        except RecordingError as error:
            assert "\n" not in str(error)  # noqa: PT017 - a cut between two rows leaves a valid file
        else:
            assert ending == "csv"
            assert 50 <= recording.samples <= 60
