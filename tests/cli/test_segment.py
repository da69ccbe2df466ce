"""The verb `segment`: printed and written results, and refusals."""

from pathlib import Path

import numpy as np
import pytest

from emaphm.actuator import Actuator
from emaphm.recording import Recording, write_recording
from emaphm.simulated_recording import simulate
from emaphm.version import VERSION

from .conftest import Emaphm, Refusal
from .test_verbs import parsed


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Return the file of a recording with a movement between two rests."""

    def command(t: np.ndarray) -> np.ndarray:
        return np.where((t >= 1.0) & (t < 2.0), 5e-3 * np.sin(2 * np.pi * 3.0 * (t - 1.0)), 0.0)

    recording = simulate(
        Actuator.thesis(), command, model="averaged", duration=3.0, sample_rate=500.0, noise=0.05
    )
    path = tmp_path_factory.mktemp("flown") / "flight.csv"
    write_recording(
        Recording({name: recording[name] for name in ("time_s", "command_rad", "current_A")}), path
    )
    return path.read_bytes()


@pytest.fixture
def flight(tmp_path: Path, flown: bytes) -> Path:
    path = tmp_path / "flight.csv"
    path.write_bytes(flown)
    return path


@pytest.mark.parametrize("number", [1, 7])
def test_a_stretch_that_is_cut_again_is_not_lost(flight: Path, number: int, refused: Refusal) -> None:
    stretch = flight.rename(flight.parent / f"stretch_{number:03d}.csv")
    content = stretch.read_bytes()
    assert "is the recording to be cut" in refused("segment", stretch, "-o", stretch.parent, "--force")
    assert stretch.read_bytes() == content


def test_segment_prints_and_writes_the_stretches(emaphm: Emaphm, flight: Path, tmp_path: Path) -> None:
    answer = parsed(emaphm, "segment", str(flight), "-o", str(tmp_path / "cut"), "--seed", "2")
    assert answer.keys() == {
        "recording",
        "actuator",
        "wanted",
        "accepted",
        "segments",
        "seed",
        "version",
        "written",
    }
    assert (answer["accepted"], answer["seed"], answer["version"]) == (1, 2, VERSION)
    assert [item["accepted"] for item in answer["segments"]] == [False, True, False]
    assert answer["segments"][0]["reason"].startswith("at rest")
    assert "friction" in answer["segments"][1]["identifies"]
    assert [Path(item).name for item in answer["written"]] == ["stretch_001.csv"]
    # The written stretch is a recording, which the healthy actuator explains.
    assert parsed(emaphm, "replay", answer["written"][0])["relative_error"]["current_A"] < 0.1


def test_segment_prints_a_table(emaphm: Emaphm, flight: Path) -> None:
    text = emaphm("segment", flight).out
    assert "Expected half-width [-] of each fault's 95 % interval" in text
    assert "refused because" in text
    assert max(map(len, text.splitlines())) <= 100
    assert "1 of 3 stretches identify something to ±0.1" in text


def test_segment_refuses_an_output_folder_before_the_work(
    emaphm: Emaphm, flight: Path, tmp_path: Path
) -> None:
    (tmp_path / "cut").mkdir()
    (tmp_path / "cut" / "stretch_002.csv").write_text("of an earlier run")
    # If the stretches were searched first, the precision would be refused.
    for out, message in (
        ("cut", "stretch_002.csv: exists already"),
        ("flight.csv", "this folder cannot be created"),
    ):
        code, text, err = emaphm("segment", flight, "--wanted", "2", "-o", tmp_path / out)
        assert (code, text) == (2, "")
        assert message in err
        assert len(err.splitlines()) == 1


def test_segment_refuses_in_one_line(emaphm: Emaphm, flight: Path) -> None:
    code, out, err = emaphm("segment", flight, "--wanted", "2")
    assert (code, out) == (2, "")
    assert err == "emaphm: a precision of ±2 is impossible; give more than 0, up to 1\n"
