"""Campaign files: the values that they give for each recording, and messages on their errors."""

from pathlib import Path

import pytest

from cases import THESIS
from emaphm.actuator import Actuator, Chirp
from emaphm.calibration import is_campaign, read_campaign
from emaphm.errors import MethodError, RecordingError
from emaphm.recording import Recording, write_recording
from emaphm.simulated_recording import simulate


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with the recordings `logs/a.csv` and `logs/b.csv`."""
    whole = simulate(THESIS, Chirp(), model="averaged", duration=0.1)
    kept = Recording({name: whole[name] for name in ("time_s", "command_rad", "current_A")}, whole.sampling)
    (tmp_path / "logs").mkdir()
    for name in ("a", "b"):
        write_recording(kept, tmp_path / "logs" / f"{name}.csv")
    return tmp_path


def written(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


TOML = """
[[recording]]
file = "logs/a.csv"
load = 0.1
position_gain = 40000

[[recording]]
file = "logs/b.csv"
temperature = 300.5
free = ["torque_constant", "viscous"]
"""
CSV = """file,load,position_gain,temperature,free
logs/a.csv,0.1,4e4,,
logs/b.csv,,,300.5,torque_constant; viscous
"""
SEMICOLONS = CSV.replace("; ", " ").replace(",", ";")


@pytest.mark.parametrize(("name", "text"), [("c.toml", TOML), ("c.csv", CSV), ("d.csv", SEMICOLONS)])
def test_toml_and_csv_give_the_same_campaign(
    folder: Path, name: str, text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(folder, name, text)
    monkeypatch.chdir(folder.parent)
    assert is_campaign(path)
    first, second = read_campaign(path, THESIS)
    assert first.recording.source.endswith("a.csv")
    assert (dict(first.known), first.free) == ({"load": 0.1, "position_gain": 4e4}, ())
    assert (dict(second.known), second.free) == ({"temperature": 300.5}, ("torque_constant", "viscous"))
    assert second.place == f"{path}, row 2"
    # The value is in each row of the recording, as if it had been recorded.
    assert set(first.completed()["load_Nm"]) == {0.1}
    assert set(second.completed()["temperature_K"]) == {300.5}


def test_a_recording_is_no_campaign(folder: Path) -> None:
    assert not is_campaign(folder / "logs" / "a.csv")
    assert not is_campaign(folder / "absent.csv")
    assert not is_campaign(folder / "log.mat")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("file,load\nlogs/absent.csv,1\n", "row 1, column 'file': there is no file .*absent.csv; give"),
        ("file,laod\nlogs/a.csv,1\n", r"row 1: unknown quantity 'laod' \(did you mean 'load'\?\)"),
        ("file,load\nlogs/a.csv,much\n", "row 1, column 'load': 'much' is no number; give one"),
        (
            "file,load\nlogs/a.csv,1\nlogs/a.csv,2\n",
            "row 2, .* in row 1 already, with other values",
        ),
        (
            "file,load\nlogs/a.csv,1\n./logs/a.csv,1\n",
            "row 2, column 'file': .* in row 1 already; leave",
        ),
        ("file,load\nlogs/a.csv,1,2\n", "row 1: has more cells than the header"),
        ("file,load, load\nlogs/a.csv,0,100\n", ": 2 columns are named 'load'; leave one"),
        ("file,file\nlogs/a.csv,logs/b.csv\n", ": 2 columns are named 'file'; leave one"),
        ("file,load\n", "no recording in this campaign"),
        ("file,load\n,1\n", "row 1: column 'file' is missing"),
        ("file,load\n,\nlogs/a.csv,much\n", "row 2, column 'load': 'much' is no number"),
        (f"file,load\n{'x' * 200_000},1\n", ": not a readable CSV file"),
    ],
)
def test_errors_in_a_row_are_named(folder: Path, text: str, message: str) -> None:
    path = written(folder, "c.csv", text)
    with pytest.raises(MethodError, match=message) as caught:
        read_campaign(path, THESIS)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[[recordings]]\nfile = "logs/a.csv"\n', "unknown key 'recordings'"),
        ('[[recording]]\nfil = "logs/a.csv"\n', r"column 'file' is missing \(did you mean 'fil'\?\)"),
        ('[recording]\nfile = "logs/a.csv"\n', r"write \[\[recording\]\] above each"),
        ('[[recording]]\nfile = "logs/a.csv"\nload = true\n', "column 'load': True is no number"),
        ('[[recording]]\nfile = "logs/a.csv"\nfree = 3\n', "column 'free': give a list"),
        ("recording = [", "not valid TOML"),
        (
            f'[[recording]]\nfile = "logs/a.csv"\nload = 1{"0" * 400}\n',
            "row 1, column 'load': 10.* no number",
        ),
        ('[[recording]]\nfile = "logs/a\\u0000.csv"\n', "row 1, column 'file': no file can have this name"),
    ],
)
def test_errors_in_a_toml_are_named(folder: Path, text: str, message: str) -> None:
    with pytest.raises(MethodError, match=message):
        read_campaign(written(folder, "c.toml", text), THESIS)


def test_a_recording_that_cannot_be_read_is_named_with_its_row(folder: Path) -> None:
    written(folder / "logs", "b.csv", "nonsense\n")
    with pytest.raises(RecordingError, match=r"c.csv, row 2: .*b.csv"):
        read_campaign(written(folder, "c.csv", "file\nlogs/a.csv\nlogs/b.csv\n"), THESIS)


def test_channels_are_named_by_the_actuator(folder: Path) -> None:
    log = folder / "logs" / "a.csv"
    log.write_text(log.read_text(encoding="utf-8").replace("current_A", "amps"), encoding="utf-8")
    named = Actuator.from_dict(THESIS.model_dump() | {"channels": {"current_A": "amps"}})
    (row,) = read_campaign(written(folder, "c.csv", "file\nlogs/a.csv\n"), named)
    assert "current_A" in row.recording
