"""Unusable recordings: each is refused in one line that names file, column, row and remedy."""

from pathlib import Path

import numpy as np
import pytest

from . import files
from .conftest import Emaphm, Refusal

NO_RESPONSE = ("current_A", "position_rad", "speed_rad_s")
GOOD = files.csv(files.columns())
UNREADABLE_CSV = ("not a readable CSV file", "comma-separated UTF-8")
UNREADABLE_PARQUET = ("not a readable Parquet file", "copy or export it again")
UNREADABLE_MAT = ("not a readable .mat file", "copy or save it again")

BAD_RECORDINGS: dict[str, tuple[bytes, tuple[str, ...]]] = {
    # columns
    "missing.csv": (
        files.csv(files.without(*NO_RESPONSE)),
        ("no column 'current_A'", "the file has: time_s, command_rad", "[channels]"),
    ),
    "no-time.csv": (files.csv(files.without("time_s")), ("no column 'time_s'", "[channels]")),
    "misspelt.csv": (
        files.csv(files.renamed("command_rad", "comand_rad")),
        ("no column 'command_rad'", "did you mean 'comand_rad'?"),
    ),
    "capital.parquet": (
        files.parquet(files.renamed("command_rad", "Command_Rad")),
        ("no column 'command_rad'", "did you mean 'Command_Rad'?"),
    ),
    "one-phase.csv": (
        files.csv(files.without(*NO_RESPONSE) | {"current_b_A": files.columns()["current_A"]}),
        ("no column 'current_a_A'", "three phase currents with angle_rad"),
    ),
    "no-angle.csv": (
        files.csv(
            files.without(*NO_RESPONSE)
            | {f"current_{phase}_A": files.columns()["current_A"] for phase in "abc"}
        ),
        ("no column 'angle_rad'", "three phase currents with angle_rad"),
    ),
    "twice.csv": (GOOD.replace(b"current_A", b"command_rad"), ("2 columns named 'command_rad'", "rename")),
    # values
    "nan.csv": (
        files.csv(files.with_value("current_A", 42, np.nan)),
        ("row 42", "'current_A'", "not a finite number", "header not included"),
    ),
    "infinite.csv": (files.csv(files.with_value("speed_rad_s", 7, -np.inf)), ("row 7", "'speed_rad_s'")),
    "nan.parquet": (
        files.parquet(files.with_value("command_rad", 190, np.nan)),
        ("row 190", "'command_rad'"),
    ),
    "null.parquet": (
        files.parquet(files.columns() | {"current_A": [*[None] * 5, *files.columns()["current_A"][5:]]}),
        ("row 1 ", "'current_A'"),
    ),
    "nan.mat": (files.mat(files.with_value("current_A", 42, np.nan)), ("row 42", "'current_A'")),
    "text.csv": (
        GOOD.replace(b"\n0.003,", b"\nthree,"),
        ("'time_s'", "'three'", "row 4", "no number"),
    ),
    "text.parquet": (
        files.parquet(files.columns() | {"current_A": ["a lot"] * 200}),
        ("'current_A'", "'a lot'", "numbers"),
    ),
    "cut.csv": (GOOD[: len(GOOD) // 2].rpartition(b",")[0], ("row 100", "no line end", "may be cut short")),
    "too-wide.csv": (GOOD.replace(b"\n0.003,", b"\n0,003,"), ("row 4 has 6 values", "5 columns")),
    "unequal.mat": (
        files.mat(files.columns() | {"current_A": np.ones(7)}),
        ("'current_A' has 7 rows", "'time_s' has 200"),
    ),
    "scalar.mat": (files.mat(files.columns() | {"current_A": 1.0}), ("'current_A'", "single number")),
    "complex.mat": (
        files.mat(files.columns() | {"current_A": 1j * files.columns()["current_A"]}),
        ("'current_A'", "real numbers"),
    ),
    "struct.mat": (files.mat({"rig": files.columns()}), ("no column 'time_s'", "rig")),
    # time
    "gap.csv": (
        files.csv(files.columns() | {"time_s": np.delete(np.arange(205) / 1e3, range(41, 46))}),
        ("not uniform", "row 42", "0.006 s", "0.001 s"),
    ),
    "decreasing.csv": (
        files.csv(files.with_value("time_s", 42, 0.0)),
        ("does not increase", "row 42", "'time_s'"),
    ),
    "repeated.csv": (files.csv(files.with_value("time_s", 42, 0.040)), ("does not increase", "row 42")),
    "rounded.csv": (
        files.csv(files.columns() | {"time_s": np.round(files.columns()["time_s"], 2)}),
        ("does not increase", "row 2"),
    ),
    "backwards.csv": (
        files.csv({name: values[::-1] for name, values in files.columns().items()}),
        ("does not increase", "row 2", "sort"),
    ),
    # manoeuvre
    "short.csv": (
        files.csv({name: values[:20] for name, values in files.columns().items()}),
        ("too short", "20 rows", "at least 50"),
    ),
    "header-only.csv": (GOOD.split(b"\n")[0] + b"\n", ("too short", "0 rows")),
    "still.csv": (files.csv(files.scaled(command_rad=0)), ("nothing was commanded", "'command_rad'")),
    # units
    "milliamperes.csv": (
        files.csv(files.scaled(current_A=1e3)),
        ("current_A reaches 18", "current limit is 22.5", "milliamperes", "convert it to A"),
    ),
    "kiloamperes.csv": (files.csv(files.scaled(current_A=1e-3)), ("current_A", "kiloamperes")),
    "milliseconds.csv": (
        files.csv(files.scaled(time_s=1e3)),
        ("rows are 1 s apart", "milliseconds", "convert it to s"),
    ),
    "degrees-commanded.csv": (
        files.csv(files.scaled(command_rad=180 / np.pi)),
        ("command_rad seems to be in degrees", "convert it to rad"),
    ),
    "degrees-measured.csv": (
        files.csv(files.scaled(position_rad=180 / np.pi)),
        ("position_rad seems to be in degrees", "convert it to rad"),
    ),
    "milliradians.csv": (
        files.csv(files.scaled(command_rad=1e3, position_rad=1e3)),
        ("command_rad reaches 5 ", "end stops are at 0.5236", "milliradians"),
    ),
    "celsius.csv": (
        files.csv(files.columns() | {"temperature_K": np.full(200, 21.5)}),
        ("temperature_K is 21.5", "add 273.15"),
    ),
    # files
    "empty.csv": (b"", ("the file is empty",)),
    "empty.parquet": (b"", ("the file is empty",)),
    "empty.mat": (b"", ("the file is empty",)),
    "blank.csv": (b"\n \n\n", UNREADABLE_CSV),
    "picture.csv": (files.PNG, UNREADABLE_CSV),
    "picture.parquet": (files.PNG, UNREADABLE_PARQUET),
    "picture.mat": (files.PNG, UNREADABLE_MAT),
    "picture.png": (files.PNG, ("'.png'", ".csv, .parquet, .mat")),
    "book.xlsx": (b"PK\x03\x04", ("'.xlsx'", ".csv, .parquet, .mat")),
    "ending": (GOOD, ("no ending", ".csv, .parquet, .mat")),
    "latin.csv": (b"caf\xe9," + GOOD.replace(b"\n", b"\n1,"), UNREADABLE_CSV),
    "utf-16.csv": (files.text(files.columns()).encode("utf-16"), UNREADABLE_CSV),
    "cut.parquet": (files.parquet(files.columns())[:2000], UNREADABLE_PARQUET),
    "cut.mat": (files.mat(files.columns())[:2000], UNREADABLE_MAT),
    "semicolons.csv": (files.text(files.columns(), ";").encode(), ("';'", "commas between columns")),
    "tabs.csv": (files.text(files.columns(), "\t").encode(), ("tabs", "commas between columns")),
}


@pytest.mark.parametrize("name", BAD_RECORDINGS)
def test_bad_recordings_are_refused_in_one_line(refused: Refusal, desk: Path, name: str) -> None:
    content, pieces = BAD_RECORDINGS[name]
    (desk / name).write_bytes(content)
    message = refused("diagnose", name)
    for piece in (name, *pieces):
        assert piece in message


@pytest.mark.parametrize("verb", ["diagnose", "replay", "calibrate --free inertia -o out.toml"])
@pytest.mark.parametrize(
    ("name", "pieces"),
    [
        ("absent.csv", ("no such file",)),
        ("folder.csv", ("is a folder",)),
        ("good.csv/within.csv", ("cannot be read", "check the path")),
        ("nan.csv", ("row 42", "'current_A'")),
        ("milliamperes.csv", ("convert it to A",)),
    ],
)
def test_all_verbs_refuse_a_bad_recording(
    refused: Refusal, desk: Path, verb: str, name: str, pieces: tuple[str, ...]
) -> None:
    (desk / "folder.csv").mkdir()
    if name in BAD_RECORDINGS:
        (desk / name).write_bytes(BAD_RECORDINGS[name][0])
    message = refused(*verb.split(), name)
    for piece in (name, *pieces):
        assert piece in message


BAD_SIGNALS: dict[str, tuple[bytes, tuple[str, ...]]] = {
    "misspelt.csv": (
        files.csv({"time_s": np.arange(3.0), "comand_rad": np.ones(3), "laod_Nm": np.ones(3)}),
        ("is missing", "did you mean '"),
    ),
    "no-time.csv": (
        files.csv({"command_rad": np.ones(3), "load_Nm": np.ones(3)}),
        ("'time_s' is missing", "needs time_s and"),
    ),
    "nan.csv": (
        files.csv({name: np.array([0, 1, np.nan]) for name in ("time_s", "command_rad", "load_Nm")}),
        ("row 3", "not finite"),
    ),
    "backwards.csv": (
        files.csv({name: np.array([0.0, 2.0, 1.0]) for name in ("time_s", "command_rad", "load_Nm")}),
        ("must increase", "row 3"),
    ),
    "one-row.csv": (
        files.csv({name: np.ones(1) for name in ("time_s", "command_rad", "load_Nm")}),
        ("2 rows or more",),
    ),
    "text.csv": (b"time_s,command_rad,load_Nm\n0,fast,heavy\n", ("row 1", "no number")),
    "empty.csv": (b"", ("the file is empty",)),
    "picture.csv": (files.PNG, UNREADABLE_CSV),
    "cut.parquet": (files.parquet(files.columns())[:2000], UNREADABLE_PARQUET),
    "unequal.mat": (
        files.mat({"time_s": np.arange(3.0), "command_rad": np.ones(4), "load_Nm": np.ones(4)}),
        ("equal columns",),
    ),
}


@pytest.mark.parametrize("option", ["--command", "--load"])
@pytest.mark.parametrize("name", BAD_SIGNALS)
def test_bad_commands_and_loads_are_refused_in_one_line(
    refused: Refusal, desk: Path, name: str, option: str
) -> None:
    content, pieces = BAD_SIGNALS[name]
    (desk / name).write_bytes(content)
    message = refused("simulate", "out.csv", option, name)
    for piece in (name, *pieces):
        assert piece in message


@pytest.mark.parametrize("option", ["--command", "--load"])
def test_a_signal_that_does_not_cover_the_time_is_refused(refused: Refusal, desk: Path, option: str) -> None:
    signal = {"time_s": 100 + np.arange(3.0), "command_rad": np.ones(3) * 1e-3, "load_Nm": np.ones(3) * 1e-3}
    (desk / "late.csv").write_bytes(files.csv(signal))
    assert "late.csv" in refused("simulate", "out.csv", "--model", "averaged", option, "late.csv")


HARMLESS = {
    "plain.csv": GOOD,
    "windows.csv": GOOD.replace(b"\n", b"\r\n"),
    "excel.csv": b"\xef\xbb\xbf" + GOOD.replace(b"\n", b"\r\n"),
    "quoted.csv": b"\xef\xbb\xbf"
    + b",".join(b'"%s"' % name for name in GOOD.split(b"\n")[0].split(b","))
    + GOOD[GOOD.index(b"\n") :],
    "blank-lines.csv": b"\n\n" + GOOD + b"\n\n",
    "spaced.csv": GOOD.replace(b",", b" , "),
    "CAPITALS.CSV": GOOD,
    "a name × with ü and blanks.csv": GOOD,
    "further columns.csv": files.csv(files.columns() | {"humidity": np.full(200, np.nan)}),
    "single.parquet": files.parquet(
        {name: values.astype(np.float32) for name, values in files.columns().items() if name != "time_s"}
        | {"time_s": files.columns()["time_s"]}
    ),
    "good.mat": files.mat(files.columns()),
}


@pytest.mark.parametrize("name", HARMLESS)
def test_unusual_but_valid_files_are_read(emaphm: Emaphm, desk: Path, name: str) -> None:
    expected = emaphm("replay", "good.csv").out
    (desk / name).write_bytes(HARMLESS[name])
    code, out, err = emaphm("replay", name)
    assert (code, err) == (0, "")
    # Single precision changes the last digits.
    if name != "single.parquet":
        assert out == expected


def test_a_line_break_in_a_name_keeps_the_message_in_one_line(refused: Refusal) -> None:
    assert "no such file" in refused("replay", "absent\nfile.csv")


@pytest.mark.parametrize(
    "names", [[f"channel_{i}" for i in range(300)], ["x" * 5000], ["\x1b[31mred\x07"], ["\x00" * 5000]]
)
def test_a_message_stays_readable_with_any_column_names(
    refused: Refusal, desk: Path, names: list[str]
) -> None:
    (desk / "odd.csv").write_text(",".join(names) + "\n1\n", encoding="utf-8")
    message = refused("replay", "odd.csv")
    assert len(message) < 1000
    assert message.strip().isprintable()


@pytest.mark.parametrize("verb", ["calibrate", "diagnose", "history add", "detect learn", "detect judge"])
def test_help_names_all_readable_file_formats(emaphm: Emaphm, verb: str) -> None:
    words = emaphm(*verb.split(), "--help").out.replace("│", " ").split()
    assert {".csv", ".parquet", ".mat", ".tdms", ".h5", ".hdf5", ".mf4"} <= {
        word.rstrip(",;.") for word in words
    }
