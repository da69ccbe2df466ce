"""The classes of spoilt inputs: each function makes a case from a random number generator.

A new kind of input is a function here and a line in `CLASSES`.
"""

import contextlib
import gzip
import io
import json
import sqlite3
import tempfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import polars as pl
import scipy.io

from emaphm.actuator import Actuator
from emaphm.actuator.toml import write_toml
from emaphm.arrays import Array
from emaphm.study import Plan, run_study

from . import spoil

THESIS = write_toml(Actuator.thesis())

REPLAY = ("replay", "{}", "--json")
"""The fastest verb that reads a recording and simulates a model."""


@dataclass(frozen=True)
class Case:
    """A command line, and the files in its folder in addition to `good.csv` and `good.toml`.

    If `prefix` is set, an accepted recording must have the first rows of the good recording, unchanged.
    """

    arguments: tuple[str, ...]
    files: dict[str, bytes] = field(default_factory=dict)
    prefix: bool = False


def columns(*, further: bool = True) -> dict[str, Array]:
    """Return 0.1 s of a healthy thesis actuator at 2 kHz, in closed form."""
    time = np.arange(200) / 2e3
    swing = 2 * np.pi * 15.0 * time
    channels = {
        "time_s": time,
        "command_rad": 5e-3 * np.sin(swing),
        "current_A": 1.5 * np.sign(np.cos(swing)) - 0.4 * np.sin(swing),
    }
    motion = {
        "position_rad": 5e-3 * np.sin(swing - 0.05),
        "speed_rad_s": 2.5 * 30 * np.pi * np.cos(swing - 0.05),
        "voltage_V": 24.0 * np.cos(swing),
        "load_Nm": np.full(200, 0.01),
        "temperature_K": np.full(200, 293.15),
    }
    return channels | motion if further else channels


@cache
def good(kind: str) -> bytes:
    """Return the good recording as "csv", "parquet", "hdf5", "tdms", "mdf", "mat73" or another "mat"."""
    file, table = io.BytesIO(), columns()
    if kind == "csv":
        return _csv(table)
    if kind == "parquet":
        pl.DataFrame(table).write_parquet(file)
    elif kind == "mat73":
        import h5py

        with h5py.File(file, "w", userblock_size=512) as hdf5:
            for name, array in table.items():
                hdf5[name] = array[None, :]
                hdf5[name].attrs["MATLAB_class"] = np.bytes_("double")
    elif kind == "hdf5":
        import h5py

        with h5py.File(file, "w") as hdf5:
            for name, array in table.items():
                hdf5[f"log/{name}"] = array
    elif kind == "tdms":
        from nptdms import ChannelObject, TdmsWriter

        with TdmsWriter(file) as tdms:
            tdms.write_segment([ChannelObject("log", name, array) for name, array in table.items()])
    elif kind == "mdf":
        return _mdf(table)
    else:
        options = {"mat4": {"format": "4"}, "mat5": {}, "mat5 packed": {"do_compression": True}}[kind]
        scipy.io.savemat(file, table, **options)  # type: ignore[arg-type] # its stubs forget file objects
    return file.getvalue()


def _mdf(table: dict[str, Array]) -> bytes:
    from asammdf import MDF, Signal

    with tempfile.TemporaryDirectory() as folder, MDF(version="4.10") as mdf:
        time = table["time_s"]
        mdf.append([Signal(array, time, name=name) for name, array in table.items() if name != "time_s"])
        return Path(mdf.save(Path(folder) / "good.mf4")).read_bytes()


def _csv(table: dict[str, Array]) -> bytes:
    rows = [
        ",".join(map(repr, row)) for row in zip(*(array.tolist() for array in table.values()), strict=True)
    ]
    return "\n".join([",".join(table), *rows, ""]).encode()


def _replay(name: str, content: bytes, *, prefix: bool = False) -> Case:
    return Case(tuple(word.format(name) for word in REPLAY), {name: content}, prefix)


def _bytewise(kind: str, name: str) -> Callable[[Random], Case]:
    return lambda random: _replay(name, random.choice(spoil.BYTEWISE)(good(kind), random))


def csv_cut(random: Random) -> Case:
    """Return a truncated CSV file: it may have fewer values, but no changed values."""
    return _replay("rec.csv", spoil.cut(good("csv"), random), prefix=True)


def csv_cell(random: Random) -> Case:
    """Return a CSV file with an odd cell."""
    lines = good("csv").decode().splitlines()
    row = random.randrange(len(lines))
    cells = lines[row].split(",")
    cells[random.randrange(len(cells))] = random.choice((*spoil.ODD_NUMBERS, *spoil.ODD_TEXTS))
    lines[row] = random.choice((",", ",", ",", ";", "\t", ",,")).join(cells)
    return _replay("rec.csv", random.choice(("\n", "\r\n", "\r")).join(lines).encode(errors="surrogatepass"))


def csv_compressed(random: Random) -> Case:
    """Return a compressed file named .csv, complete or damaged."""
    content = good("csv")
    packed = random.choice(
        (gzip.compress(content), zlib.compress(content), b"\x28\xb5\x2f\xfd" + content, b"x^" + content)
    )
    return _replay("rec.csv", random.choice((*spoil.BYTEWISE, spoil.unchanged))(packed, random))


def parquet_footer(random: Random) -> Case:
    """Return a Parquet file with a damaged footer."""
    content = good("parquet")
    length = int.from_bytes(content[-8:-4], "little")
    return _replay("rec.parquet", spoil.near(content, (len(content) - 8 - length, len(content)), random))


def parquet_columns(random: Random) -> Case:
    """Return a Parquet file of odd types and names."""
    frame = pl.DataFrame(columns())
    name = random.choice(frame.columns)
    types = (pl.String, pl.Int8, pl.UInt64, pl.Float32, pl.Boolean, pl.Duration)
    if random.random() < 0.5:
        frame = frame.with_columns(pl.col(name).cast(random.choice(types), strict=False))
    else:
        odd = random.choice((*spoil.ODD_TEXTS[:12], f"{name} ", name.upper(), "\t"))
        frame = frame.with_columns(pl.col(name).alias(odd.encode(errors="replace").decode()))
    file = io.BytesIO()
    frame.write_parquet(file)
    return _replay("rec.parquet", file.getvalue())


def mat_header(random: Random) -> Case:
    """Return a .mat file with damaged headers of the file and of its first variable."""
    kind = random.choice(("mat4", "mat5", "mat5 packed"))
    return _replay("rec.mat", spoil.near(good(kind), (0, 20) if kind == "mat4" else (100, 200), random))


def recorded_values(random: Random) -> Case:
    """Return a recording of a broken sensor, to be compared with a model, diagnosed or calibrated on."""
    table = columns(further=random.random() < 0.7)
    for _ in range(random.choice((1, 1, 2))):
        name = random.choice(list(table))
        table[name] = spoil.values(table[name], random)
    model = random.choice(("averaged", "averaged", "monitor", "reference"))
    line = random.choices(
        (
            f"replay rec.csv --json --model {model}",
            "diagnose rec.csv --json --no-correction",
            "calibrate rec.csv --json --free inertia,coulomb -o out.toml --no-correction",
        ),
        (8, 1, 1),
    )[0]
    return Case(tuple(line.split()), {"rec.csv": _csv(table)})


def toml_bytes(random: Random) -> Case:
    """Return a damaged description."""
    return _described(random.choice(spoil.BYTEWISE)(THESIS.encode(), random))


def toml_value(random: Random) -> Case:
    """Return a description with an odd value, name or line."""
    lines = THESIS.splitlines()
    row = random.choice([number for number, line in enumerate(lines) if "=" in line])
    key, _, value = lines[row].partition("=")
    odd = random.choice((*spoil.ODD_NUMBERS, *map(repr, spoil.ODD_TEXTS), "[" * 5000, "{}", "[]", "[1, 'a']"))
    match random.randrange(5):
        case 0:
            lines[row] = f"{odd} = {value}"
        case 1:
            lines.insert(row, f"[{odd}]")
        case 2:
            lines.insert(row, lines[row])
        case _:
            lines[row] = f"{key}= {odd}"
    return _described("\n".join(lines).encode(errors="surrogatepass"))


def toml_channels(random: Random) -> Case:
    """Return a description whose channels, nuisances or baseline are odd."""
    odd = random.choice((*spoil.ODD_NUMBERS, *map(repr, spoil.ODD_TEXTS)))
    section = random.choice(
        (
            f"[channels]\ncurrent_A = {odd}",
            f"[channels]\nsampling = {odd}",
            f"[channels]\ncurrent_A = {{ unit = {odd} }}",
            f"[channels]\ncurrent_A = {{ derived = {odd}, scale = {odd} }}",
            f"[channels]\nposition_rad = {{ delay_s = {odd} }}",
            f"[reading]\nkeep = {odd}",
            f"[reading]\nsplit = {odd}\nlow_pass_hz = {odd}",
            f"[nuisances]\nload = {odd}",
            f"[nuisances]\nestimated = [{odd}]",
            f'[baseline]\nnames = ["inertia"]\ncovariance = [[{odd}]]\nrecordings = ["a"]',
            f'[baseline]\nnames = ["inertia", {odd}]\ncovariance = [[1.0, 0.0], [0.0, 1.0]]\nrecordings = []',
        )
    )
    return _described(f"{THESIS}\n{section}\n".encode(errors="surrogatepass"))


def _described(content: bytes) -> Case:
    return Case(("replay", "good.csv", "--actuator", "odd.toml", "--json"), {"odd.toml": content})


LINES = (
    "simulate out.csv --model averaged --duration {} --sample-rate {} --json",
    "simulate out.csv --model averaged --amplitude {} --frequency {} --command sine --json",
    "simulate out.csv --model averaged --noise {} --adc-bits {} --json",
    "simulate out.csv --model averaged --load {} --seed {} --json",
    "simulate out.csv --model {} --command {} --json",
    "simulate {} --model averaged --fault {}",
    "simulate out.csv --model averaged --fault friction={} --fault gain={} --json",
    "replay {} --model {} --json",
    "replay good.csv --actuator {} --figure {}",
    "diagnose good.csv --method {} --model {} --json",
    "diagnose good.csv --nuisance {} --seed {} --report {}",
    "calibrate good.csv --free {} -o {} --json",
    "calibrate good.csv {} --free inertia -o out.toml --nuisance {}",
    "design --candidates 0 --tests 0 --noise {} --sample-rate {} --json",
    "design --candidates 0 --tests 0 --amplitude {} --duration {} --json",
    "design --candidates {} --tests 0 --max-amplitude {} --max-frequency {} --max-duration {} --json",
    "design --candidates 0 --tests {} --channels {} --frequency {} --command {}",
    "demo --out {} --seed {}",
    "{} {} {}",
    "study plans {}",
)
"""Command lines with gaps."""


def arguments(random: Random) -> Case:
    """Return a command line with odd arguments in one or more of its gaps."""
    odd = (*spoil.ODD_NUMBERS, *spoil.ODD_TEXTS, "good.csv", "good.toml", "absent.csv", "out.png", "out.html")
    plain = random.choice((("0.3", "0.01", "1"), ("2000", "12", "0.1"), ("averaged", "load", "good.csv")))
    line = random.choice(LINES).split()
    # If all gaps are odd, only the first is checked.
    return Case(
        tuple(word.replace("{}", random.choice(odd if random.random() < 0.4 else plain)) for word in line)
    )


def signals(random: Random) -> Case:
    """Return a command or load from a damaged file."""
    table = {"time_s": np.arange(5) / 10, "command_rad": np.ones(5) * 1e-3, "load_Nm": np.ones(5) * 1e-2}
    name = random.choice(list(table))
    if random.random() < 0.5:
        table[name] = spoil.values(table[name], random)
        content = _csv(table)
    else:
        content = random.choice(spoil.BYTEWISE)(_csv(table), random)
    option = random.choice(("--command", "--load"))
    return Case(
        ("simulate", "out.csv", "--model", "averaged", option, "odd.csv", "--json"), {"odd.csv": content}
    )


STUDY = """\
name = "small"
runs = 1

[manoeuvre]
duration = 0.05

[cases]
worn = { friction = 0.3 }
loose = { backlash = 0.4, gain = 0.7 }

[[methods]]
method = "dragonfly"
label = "few"
population = 4
iterations = 3
"""
"""A plan that takes almost no time."""

STUDY_LINE = ("study", "run", "mine.toml", "--out", "study", "--workers", "1", "--json")


@cache
def study_files() -> dict[str, bytes]:
    """Return the files of the finished study, by their path in its folder."""
    with tempfile.TemporaryDirectory(prefix="emaphm-fuzz-study-") as folder:
        run_study(Plan.from_toml_text(STUDY), folder, workers=1)
        return {name: Path(folder, name).read_bytes() for name in ("plan.json", "results.sqlite")}


def study_bytes(random: Random) -> Case:
    """Return the folder of a finished study in which one file is damaged."""
    files = study_files()
    name = random.choice(list(files))
    return _study(files | {name: random.choice(spoil.BYTEWISE)(files[name], random)})


def study_plan(random: Random) -> Case:
    """Return the folder of a finished study in whose plan one value is odd."""
    plan = json.loads(study_files()["plan.json"])
    place: Any = plan
    while True:
        keys = list(place) if isinstance(place, dict) else list(range(len(place)))
        key = random.choice(keys)
        if not isinstance(place[key], dict | list) or not place[key] or random.random() < 0.2:
            break
        place = place[key]
    place[key] = random.choice((None, [], {}, -1, 0, 1e308, "x" * 5000, [[[]]], {"a": {"b": []}}, True, "\0"))
    return _study(study_files() | {"plan.json": json.dumps(plan).encode()})


def study_results(random: Random) -> Case:
    """Return the folder of a finished study in whose results one value is odd."""
    odd = random.choice((None, "", "null", "[]", "{}", "[[]]", '{"found": null}', -1, 1e308, b"\0", "nan"))
    column = random.choice(("key", "result", "wall_seconds", "cpu_seconds", "digest"))
    with tempfile.TemporaryDirectory(prefix="emaphm-fuzz-study-") as folder:
        path = Path(folder, "results.sqlite")
        path.write_bytes(study_files()["results.sqlite"])
        with contextlib.closing(sqlite3.connect(path)) as connection:
            limit = random.choice(("WHERE rowid = 1", "WHERE rowid = 2"))
            with contextlib.suppress(sqlite3.IntegrityError):
                connection.execute(f"UPDATE results SET {column} = ? {limit}", (odd,))  # noqa: S608 - constant names
            connection.commit()
        return _study(study_files() | {"results.sqlite": path.read_bytes()})


def _study(files: dict[str, bytes]) -> Case:
    inside = {f"study/{name}": content for name, content in files.items()}
    return Case(STUDY_LINE, {"mine.toml": STUDY.encode()} | inside)


CLASSES: dict[str, tuple[Callable[[Random], Case], int]] = {
    "csv: bytes": (_bytewise("csv", "rec.csv"), 4),
    "csv: cut": (csv_cut, 4),
    "csv: cell": (csv_cell, 4),
    "csv: compressed": (csv_compressed, 2),
    "parquet: bytes": (_bytewise("parquet", "rec.parquet"), 1),
    "parquet: footer": (parquet_footer, 1),
    "parquet: columns": (parquet_columns, 1),
    "mat 4: bytes": (_bytewise("mat4", "rec.mat"), 4),
    "mat 5: bytes": (_bytewise("mat5", "rec.mat"), 4),
    "mat 5: packed": (_bytewise("mat5 packed", "rec.mat"), 4),
    "mat: header": (mat_header, 4),
    "values": (recorded_values, 4),
    "toml: bytes": (toml_bytes, 4),
    "toml: value": (toml_value, 4),
    "toml: sections": (toml_channels, 4),
    "arguments": (arguments, 6),
    "signals": (signals, 2),
    "study: bytes": (study_bytes, 2),
    "study: plan": (study_plan, 2),
    "study: results": (study_results, 2),
}
"""Function and relative frequency of each class; classes that start a process are rarer."""

if find_spec("h5py"):
    CLASSES["mat 7.3: bytes"] = (_bytewise("mat73", "rec.mat"), 1)
    CLASSES["hdf5: bytes"] = (_bytewise("hdf5", "rec.h5"), 1)

if find_spec("nptdms"):
    CLASSES["tdms: bytes"] = (_bytewise("tdms", "rec.tdms"), 1)

if find_spec("asammdf"):
    CLASSES["mdf: bytes"] = (_bytewise("mdf", "rec.mf4"), 1)
