"""Files too large for memory or time are refused unread; foreign formats are read in their own process."""

import gzip
import math
import os
import sys
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import scipy.io

from emaphm.actuator import Actuator
from emaphm.recording import read_recording
from emaphm.recording.io import foreign_columns, reader_process
from emaphm.recording.io.limits import ReadLimits

from .conftest import Columns, Refusal

SMALL = ReadLimits(file_bytes=100_000, rows=1000, columns=20, numbers=5000)


def _csv(columns: Columns) -> bytes:
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    return "\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows), ""]).encode()


def _parquet(path: Path, columns: Columns) -> None:
    pl.DataFrame(columns).write_parquet(path)


def _write(path: Path, columns: Columns) -> None:
    """Write a file in the format of its ending; a .mat file is compressed."""
    if path.suffix == ".csv":
        path.write_bytes(_csv(columns))
    elif path.suffix == ".parquet":
        _parquet(path, columns)
    else:
        scipy.io.savemat(path, columns, do_compression=True)


# Sizes


@pytest.mark.parametrize("ending", ["csv", "parquet", "mat"])
def test_a_file_with_too_many_rows_is_refused_with_the_remedy(
    tmp_path: Path, thesis: Actuator, refusal: Refusal, ending: str
) -> None:
    # Nearly equal values compress well: the file size says little about the number of values.
    path, columns = tmp_path / f"rec.{ending}", {"time_s": np.zeros(1001), "current_A": np.zeros(1001)}
    _write(path, columns)
    text = refusal(lambda: read_recording(path, thesis, limits=SMALL))
    for piece in (str(path), "1,001 rows", "1,000 are read at most", "cut one manoeuvre", "head -n"):
        assert piece in text


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_a_file_with_too_many_columns_is_refused(
    tmp_path: Path, thesis: Actuator, refusal: Refusal, ending: str
) -> None:
    path, columns = tmp_path / f"rec.{ending}", {f"c{i}": np.zeros(2) for i in range(21)}
    _write(path, columns)
    assert "21 columns" in refusal(lambda: read_recording(path, thesis, limits=SMALL))


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_a_file_with_too_many_numbers_is_refused(
    tmp_path: Path, thesis: Actuator, refusal: Refusal, ending: str
) -> None:
    path, columns = tmp_path / f"rec.{ending}", {f"c{i}": np.zeros(900) for i in range(6)}
    _write(path, columns)
    assert "5,000 numbers are read at most" in refusal(lambda: read_recording(path, thesis, limits=SMALL))


def test_a_large_file_is_refused_unread(tmp_path: Path, thesis: Actuator, refusal: Refusal) -> None:
    path = tmp_path / "rec.csv"
    with path.open("wb") as file:
        file.truncate(600 * 2**20)  # takes no space on the disk
    text = refusal(lambda: read_recording(path, thesis))
    assert "600 MiB" in text
    assert "512 MiB are read at most" in text


def test_a_compressed_variable_is_not_expanded_beyond_the_limit(
    tmp_path: Path, thesis: Actuator, refusal: Refusal
) -> None:
    path = tmp_path / "rec.mat"
    scipy.io.savemat(path, {"time_s": np.zeros((100, 1000))}, do_compression=True)
    assert "when unpacked" in refusal(lambda: read_recording(path, thesis, limits=SMALL))


@pytest.mark.skipif(sys.platform == "win32", reason="needs pipes and devices in the file system")
@pytest.mark.parametrize("ending", ["csv", "parquet", "mat"])
def test_pipes_and_devices_are_refused_unread(
    tmp_path: Path, thesis: Actuator, refusal: Refusal, ending: str
) -> None:
    pipe, device = tmp_path / f"pipe.{ending}", tmp_path / f"device.{ending}"
    os.mkfifo(pipe)
    device.symlink_to("/dev/zero")
    for path in (pipe, device):
        assert "not a regular file" in refusal(lambda path=path: read_recording(path, thesis))  # type: ignore[misc]


def test_a_null_character_in_the_file_name_is_refused(thesis: Actuator, refusal: Refusal) -> None:
    assert "no file can have this name" in refusal(lambda: read_recording("a\0b.csv", thesis))


# CSV


@pytest.mark.parametrize(
    ("pack", "name"),
    [(gzip.compress, "gzip"), (lambda content: b"\x28\xb5\x2f\xfd" + content, "zstd")],
)
@pytest.mark.parametrize("keep", [1.0, 0.5])
def test_compressed_text_is_named_in_the_message(
    columns: Columns,
    tmp_path: Path,
    thesis: Actuator,
    refusal: Refusal,
    pack: Callable[[bytes], bytes],
    name: str,
    keep: float,
) -> None:
    packed = pack(_csv(columns))
    (tmp_path / "rec.csv").write_bytes(packed[: int(keep * len(packed))])
    text = refusal(lambda: read_recording(tmp_path / "rec.csv", thesis))
    assert f"is compressed ({name}); unpack it first" in text


@pytest.mark.parametrize("level", [1, 6, 9])
def test_zlib_content_is_not_read_as_text(
    columns: Columns, tmp_path: Path, thesis: Actuator, refusal: Refusal, level: int
) -> None:
    (tmp_path / "rec.csv").write_bytes(zlib.compress(_csv(columns), level))
    assert "not a readable CSV file" in refusal(lambda: read_recording(tmp_path / "rec.csv", thesis))


def test_text_that_begins_like_zlib_is_read(columns: Columns, tmp_path: Path, thesis: Actuator) -> None:
    (tmp_path / "rec.csv").write_bytes(_csv({"x^2": columns["current_A"] ** 2, **columns}))
    recording = read_recording(tmp_path / "rec.csv", thesis)
    np.testing.assert_array_equal(recording["x^2"], columns["current_A"] ** 2)


def test_a_cut_file_is_never_read_with_a_wrong_value(
    columns: Columns, tmp_path: Path, thesis: Actuator
) -> None:
    # All cuts within the last row and the end of the row before, at any place in a number.
    del columns["temperature_K"]
    short = {name: values[:60] for name, values in columns.items()}
    content, path = _csv(short), tmp_path / "rec.csv"
    accepted = 0
    for length in range(len(content) - 130, len(content) + 1):
        path.write_bytes(content[:length])
        try:
            recording = read_recording(path, thesis)
        except ValueError as error:
            assert "\n" not in str(error)  # noqa: PT017
            continue
        accepted += 1
        for name, values in short.items():
            np.testing.assert_array_equal(recording[name], values[: recording.samples])
    assert accepted >= 2  # the complete file, and a cut after a line


@pytest.mark.parametrize(
    ("last", "whole"), [("1.25", True), ("1.2", False), ("-0.5", True), ('"1"', True), ("1 ", True)]
)
def test_a_last_value_without_line_end_is_accepted_if_it_has_full_length(
    columns: Columns, tmp_path: Path, thesis: Actuator, refusal: Refusal, last: str, whole: bool
) -> None:
    rows = [f"{time!r},0.001,{1 + row % 2 / 4:.2f}" for row, time in enumerate(columns["time_s"].tolist())]
    text = "\n".join(["time_s,command_rad,current_A", *rows[:99], f"{rows[99].rpartition(',')[0]},{last}"])
    path = tmp_path / "rec.csv"
    path.write_text(text)
    if whole:
        assert read_recording(path, thesis)["current_A"][-1] == float(last.strip('"'))
        return
    message = refusal(lambda: read_recording(path, thesis))
    for piece in ("'current_A'", "'1.2'", "row 100", "may be cut short", "add a line end"):
        assert piece in message


# Foreign formats


def test_an_abort_of_the_parquet_library_is_reported_as_a_damaged_file(
    tmp_path: Path, thesis: Actuator, refusal: Refusal, capfd: pytest.CaptureFixture[str]
) -> None:
    # A footer whose schema claims 2**60 columns: the library reserves memory for them, and aborts.
    footer = b"\x15\x02\x19\xfc" + b"\x80" * 8 + b"\x10"
    path = tmp_path / "rec.parquet"
    path.write_bytes(b"PAR1" + footer + len(footer).to_bytes(4, "little") + b"PAR1")
    assert "not a readable Parquet file" in refusal(lambda: read_recording(path, thesis))
    assert capfd.readouterr() == ("", "")


def test_a_panic_of_the_parquet_library_is_reported_as_a_damaged_file(
    columns: Columns, tmp_path: Path, thesis: Actuator, refusal: Refusal, monkeypatch: pytest.MonkeyPatch
) -> None:
    def panic(*_: object) -> None:
        raise pl.exceptions.PanicException("called unwrap on None\nnote: see the trace")

    path = tmp_path / "rec.parquet"
    _parquet(path, columns)
    monkeypatch.setattr(pl, "read_parquet", panic)
    assert "not a readable Parquet file (called unwrap on None)" in refusal(
        lambda: read_recording(path, thesis, limits=ReadLimits(isolated=False))
    )


def test_a_reader_process_that_takes_too_long_is_ended(
    columns: Columns, tmp_path: Path, thesis: Actuator, refusal: Refusal, monkeypatch: pytest.MonkeyPatch
) -> None:
    _parquet(tmp_path / "rec.parquet", columns)
    monkeypatch.setattr(reader_process, "_idle", {})  # a new one takes longer to start
    hasty = ReadLimits(seconds=1e-3)
    assert "after 0.001 s" in refusal(lambda: read_recording(tmp_path / "rec.parquet", thesis, limits=hasty))


@pytest.mark.parametrize("isolated", [True, False])
def test_reading_in_isolation_gives_the_same_bits(
    columns: Columns, tmp_path: Path, thesis: Actuator, isolated: bool
) -> None:
    _parquet(tmp_path / "rec.parquet", columns)
    recording = read_recording(tmp_path / "rec.parquet", thesis, limits=ReadLimits(isolated=isolated))
    for name, values in columns.items():
        np.testing.assert_array_equal(recording[name], values)


def test_parquet_names_that_differ_only_by_a_blank_are_refused(
    columns: Columns, tmp_path: Path, thesis: Actuator, refusal: Refusal
) -> None:
    _parquet(tmp_path / "rec.parquet", {**columns, "current_A ": 2 * columns["current_A"]})
    text = refusal(lambda: read_recording(tmp_path / "rec.parquet", thesis))
    assert "2 columns named 'current_A'; rename or drop all but one" in text


# MATLAB


def test_zeroed_bytes_of_a_mat_file_are_refused(
    columns: Columns, tmp_path: Path, thesis: Actuator, refusal: Refusal
) -> None:
    # SciPy's own reader ends in a segmentation fault here.
    path = tmp_path / "rec.mat"
    scipy.io.savemat(path, {"time_s": columns["time_s"]})
    content = path.read_bytes()
    path.write_bytes(content[:180] + bytes(10) + content[190:200])
    assert "not a readable .mat file" in refusal(lambda: read_recording(path, thesis))


@pytest.mark.parametrize("options", [{}, {"do_compression": True}, {"format": "4"}], ids=["5", "7", "4"])
@pytest.mark.parametrize("kind", ["f8", "f4", "i1", "i2", "i4", "u1", "u2", "u4"])
def test_the_mat_reader_agrees_with_scipys_reader(
    tmp_path: Path, thesis: Actuator, options: dict[str, str], kind: str, columns: Columns
) -> None:
    path, numbers = tmp_path / "rec.mat", np.arange(2500) % 100
    scipy.io.savemat(path, {**columns, "n": numbers.astype(kind), "f": np.ones((2, 2), "f4")}, **options)  # type: ignore[arg-type]
    oracle = scipy.io.loadmat(path)
    recording = read_recording(path, thesis)
    for name in (*columns, "n"):
        np.testing.assert_array_equal(recording[name], oracle[name].ravel())
    assert "f" not in recording


def test_a_big_endian_mat_file_is_read(columns: Columns, tmp_path: Path, thesis: Actuator) -> None:
    def element(kind: int, body: bytes) -> bytes:
        padding = bytes(-len(body) % 8)
        return kind.to_bytes(4, "big") + len(body).to_bytes(4, "big") + body + padding

    content = b"MATLAB 5.0".ljust(124) + b"\x01\x00MI"
    for name, values in columns.items():
        body = element(6, (6).to_bytes(4, "big") + bytes(4))
        body += element(5, values.size.to_bytes(4, "big") + (1).to_bytes(4, "big"))
        body += element(1, name.encode()) + element(9, values.astype(">f8").tobytes())
        content += element(14, body)
    (tmp_path / "rec.mat").write_bytes(content)
    recording = read_recording(tmp_path / "rec.mat", thesis)
    for name, values in columns.items():
        np.testing.assert_array_equal(recording[name], values)


def _soft_link(file: object) -> None:
    import h5py

    file["current_A"] = h5py.SoftLink("/nowhere")  # type: ignore[index]


def _external_link(file: object) -> None:
    import h5py

    file["current_A"] = h5py.ExternalLink("/dev/zero", "/x")  # type: ignore[index]


def _unallocated(file: object) -> None:
    file.create_dataset("current_A", (1, 800_000_000), "f8", chunks=(1, 1000))  # type: ignore[attr-defined]


def _empty_class(file: object) -> None:
    import h5py

    file["current_A"] = np.ones((1, 2500))  # type: ignore[index]
    file["current_A"].attrs["MATLAB_class"] = h5py.Empty("S1")  # type: ignore[index]
    file["command_rad"][...] = math.nan  # type: ignore[index]


@pytest.mark.parametrize(
    ("spoil", "piece"),
    [
        (_soft_link, "'current_A' is a link to elsewhere"),
        (_external_link, "'current_A' is a link to elsewhere"),
        (_unallocated, "800,000,000 rows"),
        (_empty_class, "row 1 of column 'command_rad'"),  # entries after an empty class are checked as usual
    ],
)
def test_odd_hdf5_files_are_refused(
    columns: Columns,
    tmp_path: Path,
    thesis: Actuator,
    refusal: Refusal,
    spoil: Callable[[object], None],
    piece: str,
) -> None:
    h5py = pytest.importorskip("h5py", reason="MATLAB 7.3 files need h5py")
    path = tmp_path / "rec.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in columns.items():
            if name != "current_A":
                file[name] = values[None, :]
        spoil(file)
    assert piece in refusal(lambda: read_recording(path, thesis))


def test_the_isolated_reader_does_not_import_the_package() -> None:
    # It would start slowly if it imported the package.
    source = Path(foreign_columns.__file__).read_text(encoding="utf-8")
    assert "import emaphm" not in source
    assert "from emaphm" not in source
