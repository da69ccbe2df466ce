"""TDMS, HDF5 and MDF 4 files that were written by the libraries of these formats."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from emaphm.actuator import Actuator
from emaphm.actuator.channels import Channels
from emaphm.actuator.reading import Reading
from emaphm.recording import read_recording, read_recordings
from emaphm.recording.io.limits import ReadLimits

from .conftest import Columns, Refusal, half_a_second

ENDINGS = ("tdms", "h5", "mf4")
SLOW = {"column": "Slow/T", "unit": "degC"}
START = np.datetime64("2026-01-01T00:00:00")


def rig(thesis: Actuator, reading: dict[str, Any] | None = None, **channels: Any) -> Actuator:
    sections = {"channels": Channels(sampling="instant", **channels), "reading": Reading(**(reading or {}))}
    return thesis.model_copy(update=sections)


def measured(columns: Columns) -> Columns:
    return {name: columns[name] for name in ("command_rad", "position_rad", "current_A")}


def tdms(columns: Columns, folder: Path, late_s: float = 0.0, start: np.datetime64 = START) -> Path:
    """Save a group of 5 kHz waveforms from `start` on, and a second group at 100 Hz that begins later."""
    nptdms = pytest.importorskip("nptdms", reason="TDMS files need npTDMS")
    fast = {"wf_increment": 2e-4, "wf_start_time": start}
    later = START + np.timedelta64(round(1e6 * late_s), "us")
    slow = {"wf_increment": 1e-2, "wf_start_time": later}
    temperature = 20 + np.arange(60) * 0.1
    objects = [
        nptdms.ChannelObject("Drive", name, values, fast) for name, values in measured(columns).items()
    ]
    objects += [
        nptdms.ChannelObject("Slow", "T", temperature, slow),
        nptdms.ChannelObject("Slow", "remark", ["a", "b"]),
    ]
    with nptdms.TdmsWriter(str(folder / "rec.tdms")) as file:
        file.write_segment(objects)
    return folder / "rec.tdms"


def h5(columns: Columns, folder: Path) -> Path:
    """Save vectors and a table in groups, with links."""
    h5py = pytest.importorskip("h5py", reason="HDF5 files need h5py")
    with h5py.File(folder / "rec.h5", "w") as file:
        for name, values in measured(columns).items():
            file[f"Drive/log/{name}"] = values
        file["Drive/log/time_s"] = columns["time_s"]
        times = np.arange(60) * 1e-2
        file["Slow"] = np.array(
            list(zip(times, 20 + times * 10, strict=True)), dtype=[("t", "f8"), ("T", "f4")]
        )
        file["Drive/again"] = file["Drive"]  # a circle
        file["elsewhere"] = h5py.ExternalLink("other.h5", "current")
        file["nowhere"] = h5py.SoftLink("/Drive/none")
    return folder / "rec.h5"


def mf4(columns: Columns, folder: Path) -> Path:
    """Save three groups with their own times; `T` is in two groups, `z` twice in one group."""
    asammdf = pytest.importorskip("asammdf", reason="MDF 4 files need asammdf")
    time, slow = columns["time_s"], np.arange(60) * 1e-2

    def signal(name: str, values: Any, at: Any) -> Any:
        return asammdf.Signal(np.asarray(values), at, name=name)

    with asammdf.MDF(version="4.10") as file:
        file.append(
            [signal(name, values, time) for name, values in measured(columns).items()], acq_name="Drive"
        )
        file.append([signal("T", 20 + slow * 10, slow)], acq_name="Slow")
        file.append(
            [signal("T", slow, slow), signal("z", slow, slow), signal("z", slow, slow)], acq_name="Other"
        )
        file.save(folder / "rec.mf4", overwrite=True)
    return folder / "rec.mf4"


SAVE: dict[str, Callable[[Columns, Path], Path]] = {"tdms": tdms, "h5": h5, "mf4": mf4}

Saved = Callable[[str], Path]


HERE = ReadLimits(isolated=False)
"""Read in this process: a reader process that refused a file is not reused, and loading MDF takes seconds."""


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Saved:
    """Return a function that saves a file with a given ending once; the file must not be changed."""
    return cache(lambda ending: SAVE[ending](half_a_second(), tmp_path_factory.mktemp(ending)))


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_logger_file_is_read_back_unchanged(
    columns: Columns, saved: Saved, thesis: Actuator, ending: str
) -> None:
    temperature = SLOW | {"time": "Slow/t"} if ending == "h5" else SLOW
    recording = read_recording(saved(ending), rig(thesis, temperature_K=temperature))
    np.testing.assert_allclose(recording["time_s"], columns["time_s"], atol=1e-12)
    for name, values in measured(columns).items():
        np.testing.assert_array_equal(recording[name], values)
    # 10 K/s, at the times of the command.
    np.testing.assert_allclose(recording["temperature_K"], 293.15 + 10 * columns["time_s"], atol=1e-5)
    assert any("Slow/T: brought from times of their own" in note for note in recording.notes)


def test_waveforms_that_begin_at_different_times_are_aligned(
    columns: Columns, tmp_path: Path, thesis: Actuator
) -> None:
    path = tdms(columns, tmp_path, late_s=0.1)
    recording = read_recording(path, rig(thesis, temperature_K=SLOW))
    np.testing.assert_allclose(recording["time_s"][[0, -1]], [0.1, 0.4998])
    np.testing.assert_allclose(
        recording["temperature_K"], 293.15 + 10 * (recording["time_s"] - 0.1), atol=1e-9
    )


def test_waveforms_without_a_start_time_begin_with_the_other_waveforms(
    columns: Columns, tmp_path: Path, thesis: Actuator
) -> None:
    path = tdms(columns, tmp_path, start=np.datetime64("1904-01-01T00:00:00"))  # LabVIEW's zero time
    recording = read_recording(path, rig(thesis, temperature_K=SLOW))
    np.testing.assert_allclose(recording["time_s"], columns["time_s"], atol=1e-12)
    np.testing.assert_allclose(recording["temperature_K"], 293.15 + 10 * columns["time_s"], atol=1e-9)


def test_a_text_column_splits_a_parquet_file(columns: Columns, tmp_path: Path, thesis: Actuator) -> None:
    import polars as pl

    profile = np.repeat(["trap", "sine"], [1000, 1500])
    pl.DataFrame({**columns, "profile": profile}).write_parquet(tmp_path / "rec.parquet")
    recordings = read_recordings(tmp_path / "rec.parquet", thesis, split="profile")
    assert [(recording.labels["profile"], recording.samples) for recording in recordings] == [
        ("trap", 1000),
        ("sine", 1500),
    ]


def test_flags_and_categories_of_a_parquet_file_are_read_by_name(
    columns: Columns, tmp_path: Path, thesis: Actuator, refusal: Refusal
) -> None:
    import polars as pl

    late, steps = columns["time_s"] >= 0.1, np.repeat(["warm", "cold"], [1500, 1000])
    frame = pl.DataFrame({**columns, "on": late, "step": steps, "day": columns["time_s"]}).with_columns(
        pl.col("step").cast(pl.Categorical), same=pl.col("step").cast(pl.Enum(["warm", "cold"])),
        day=pl.from_epoch("day"),
    )  # fmt: skip
    frame.write_parquet(tmp_path / "rec.parquet")
    selection = rig(thesis, {"keep": "on and same == step"})
    recordings = read_recordings(tmp_path / "rec.parquet", selection, split="step")
    assert [(recording.labels["step"], recording.samples) for recording in recordings] == [
        ("warm", 1000),
        ("cold", 1000),
    ]
    enabled = read_recording(tmp_path / "rec.parquet", rig(thesis, enabled="on"))["enabled"]
    np.testing.assert_array_equal(enabled, late)
    for refused in (
        lambda: read_recordings(tmp_path / "rec.parquet", thesis, split="day"),
        lambda: read_recording(tmp_path / "rec.parquet", rig(thesis, {"keep": "day > 1"})),
    ):
        assert "column 'day' is of type Datetime" in refusal(refused)


def test_flags_of_an_hdf5_file_are_read(columns: Columns, tmp_path: Path, thesis: Actuator) -> None:
    h5py = pytest.importorskip("h5py", reason="HDF5 files need h5py")
    with h5py.File(tmp_path / "rec.h5", "w") as file:
        for name, values in {**columns, "on": columns["time_s"] >= 0.1}.items():
            file[name] = values
    recording = read_recording(tmp_path / "rec.h5", rig(thesis, {"keep": "on"}))
    np.testing.assert_array_equal(recording["time_s"], columns["time_s"][columns["time_s"] >= 0.1])


BAD = {
    "no such group": ("tdms", "Drives/current_A", ["no group 'Drives'", "did you mean 'Drive'"]),
    "no such channel": ("tdms", "Drive/curent_A", ["'Drive/curent_A'", "did you mean 'Drive/current_A'"]),
    "a text": ("tdms", "Slow/remark", ["'Slow/remark' (current_A) is not numeric"]),
    "a link out of the file": ("h5", "elsewhere", ["'elsewhere' (current_A) is a link to elsewhere"]),
    "a link to nowhere": ("h5", "nowhere", ["is a link to elsewhere"]),
    "the same name in two groups": ("mf4", "T", ["2 columns are named 'T' (Slow/T, Other/T)", "the group"]),
    "the same name twice in a group": ("mf4", "z", ["'Other/z' (current_A) is there 2 times", "rename"]),
    "not in the MDF": ("mf4", "Drive/curent_A", ["'Drive/curent_A'", "did you mean 'Drive/current_A'"]),
}


@pytest.mark.parametrize(("ending", "name", "expected"), BAD.values(), ids=BAD.keys())
def test_a_column_missing_from_the_file_is_refused(
    saved: Saved,
    thesis: Actuator,
    refusal: Refusal,
    ending: str,
    name: str,
    expected: list[str],
) -> None:
    path = saved(ending)
    text = refusal(lambda: read_recording(path, rig(thesis, current_A=name), limits=HERE))
    for part in (str(path), *expected):
        assert part in text


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "cut": lambda raw: raw[: len(raw) // 2],
    "noise": lambda raw: raw[::-1],
}


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_file_is_refused(
    saved: Saved,
    tmp_path: Path,
    thesis: Actuator,
    refusal: Refusal,
    ending: str,
    damage: str,
) -> None:
    path = tmp_path / f"rec.{ending}"
    path.write_bytes(DAMAGES[damage](saved(ending).read_bytes()))
    limits = HERE if (ending, damage) == ("mf4", "noise") else ReadLimits()
    assert str(path) in refusal(lambda: read_recording(path, thesis, limits=limits))


def test_a_state_with_its_own_times_is_not_interpolated(
    columns: Columns, tmp_path: Path, thesis: Actuator
) -> None:
    asammdf = pytest.importorskip("asammdf", reason="MDF 4 files need asammdf")
    slow = np.arange(60) * 1e-2
    with asammdf.MDF(version="4.10") as file:
        signals = [
            asammdf.Signal(np.asarray(values), columns["time_s"], name=name)
            for name, values in measured(columns).items()
        ]
        file.append(signals)
        file.append([asammdf.Signal(np.where(slow < 0.2, 0.0, 7.0), slow, name="mode")])
        file.save(tmp_path / "day.mf4", overwrite=True)
    actuator = rig(thesis).model_copy(update={"reading": Reading(keep="mode == 7")})
    recording = read_recording(tmp_path / "day.mf4", actuator, limits=HERE)
    assert recording["time_s"][0] == pytest.approx(0.2, abs=1e-9)
    assert recording["time_s"][-1] == columns["time_s"][-1]
