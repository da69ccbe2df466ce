"""An actuator's TOML: written values are read back unchanged, and errors are named in one line."""

import errno
import tomllib
from pathlib import Path

import pytest
from hypothesis import given

from emaphm.actuator import Actuator
from emaphm.actuator.unit.baseline import Baseline
from emaphm.errors import ActuatorError, OutputError
from strategies import actuators


@given(actuator=actuators())
def test_a_round_trip_keeps_all_values(actuator: Actuator, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.getbasetemp() / "round_trip.toml"
    actuator.to_toml(path)
    assert Actuator.from_toml(path) == actuator


def test_a_round_trip_keeps_the_thesis_actuator(tmp_path: Path) -> None:
    path = tmp_path / "thesis.toml"
    Actuator.thesis().to_toml(path)
    assert Actuator.load(path) == Actuator.thesis() == Actuator.load("thesis")


def test_a_round_trip_keeps_a_linear_actuator_without_electrical_section(tmp_path: Path) -> None:
    values = Actuator.thesis().model_dump()
    del values["electrical"]
    values |= {"name": "slide", "coordinates": "linear", "channels": {"command_rad": "qg"}}
    values["controller"]["speed_limit"] = None
    values["mechanics"]["end_stops"] = None
    slide = Actuator.from_dict(values)
    path = tmp_path / "slide.toml"
    slide.to_toml(path, comments="first line\nsecond line")
    text = path.read_text(encoding="utf-8")
    assert text.startswith("# first line\n# second line\n")
    assert Actuator.from_toml(path) == slide
    assert slide.electrical is None
    assert tomllib.loads(text)["channels"] == {"command_rad": "qg"}


def comment_of(key: str, text: str) -> str:
    line = next(line for line in text.splitlines() if line.startswith(f"{key} ="))
    return line.partition("# ")[2]


@pytest.mark.parametrize(
    ("key", "rotary", "linear"),
    [
        ("inertia_motor", "kg·m²", "kg"),
        ("viscous_motor", "N·m·s/rad", "N·s/m"),
        ("dynamic_friction_user", "N·m", "N"),
        ("backlash", "rad", "m"),
        ("resistance", "ohm", "ohm"),
        ("position_gain", "1/s", "1/s"),
    ],
)
def test_each_value_has_its_unit_in_a_comment(key: str, rotary: str, linear: str, tmp_path: Path) -> None:
    thesis = Actuator.thesis()
    for actuator, unit in (
        (thesis, rotary),
        (thesis.model_copy(update={"coordinates": "linear"}), linear),
    ):
        path = tmp_path / "actuator.toml"
        actuator.to_toml(path)
        assert comment_of(key, path.read_text(encoding="utf-8")).startswith(f"{unit}: ")


def complaint_about(path: Path) -> str:
    with pytest.raises(ActuatorError) as caught:
        Actuator.from_toml(path)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(f"{path}: ")
    return message


WRONG = {
    "misspelt key": ("inertia_user = ", "inertia_usr = ", ("'mechanics.inertia_usr'", "'inertia_user'?")),
    "misspelt section": ("[mechanics]", "[mechanic]", ("'mechanic'", "did you mean 'mechanics'?")),
    "unlike any key": ("backlash = 0.005", "qqqq = 1", ("'mechanics.qqqq'", "known: ", "gear_ratio")),
    "misspelt channel": (
        "[controller]",
        '[channels]\nspeed_rads = "v"\n[controller]',
        ("'channels.speed_rads'", "did you mean 'speed_rad_s'?"),
    ),
    "missing key": ("supply = ", "# ", ("'electrical.supply' is missing", "supply voltage", "add it")),
    "missing name": ('name = "thesis"', "", ("'name' is missing", "add it")),
    "negative inertia": (
        "inertia_motor = ",
        "inertia_motor = -",
        ("'mechanics.inertia_motor'", "greater than or equal to 0", "got -1.3e-05"),
    ),
    "zero gear ratio": ("gear_ratio = 0.002", "gear_ratio = 0", ("'mechanics.gear_ratio'", "greater than 0")),
    "infinite value": ("supply = 48.0", "supply = inf", ("'electrical.supply'", "finite")),
    "text for a number": ("supply = 48.0", 'supply = "high"', ("'electrical.supply'", "got 'high'")),
    "half a pole pair": ("pole_pairs = 2", "pole_pairs = 2.5", ("'electrical.pole_pairs'", "got 2.5")),
    "unknown coordinates": (
        '= "rotary"',
        '= "polar"',
        ("'coordinates'", "'rotary', 'linear' or 'screw'", "'polar'"),
    ),
    "stops the wrong way round": (
        "end_stops = [-0.5236, 0.5236]",
        "end_stops = [0.5, 0.1]",
        ("'mechanics'", "end_stops [0.5, 0.1]", "lower one first"),
    ),
    "dynamic above static": (
        "dynamic_friction_motor = ",
        "dynamic_friction_motor = 1",
        ("'mechanics'", "dynamic friction", "must not exceed static friction"),
    ),
    "no inertia": (
        "inertia_motor = 1.3e-05",
        "inertia_motor = 0",
        ("'mechanics'", "inertia_motor + inertia_user must be greater than 0"),
    ),
    "eccentricity that touches": (
        "eccentricity = 0.42",
        "eccentricity = 1.2",
        ("'faults.eccentricity'", "less than 1"),
    ),
    "no TOML": ("name = ", "name ", ("not valid TOML", "line 1", "correct the syntax")),
}


@pytest.mark.parametrize("case", WRONG)
def test_an_error_names_file_key_and_remedy(case: str, tmp_path: Path) -> None:
    old, new, expected = WRONG[case]
    path = tmp_path / "actuator.toml"
    Actuator.thesis().to_toml(path)
    text = path.read_text(encoding="utf-8")
    if case == "no inertia":
        text = text.replace("inertia_user = 1.2e-05", "inertia_user = 0")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    message = complaint_about(path)
    for part in expected:
        assert part in message


def test_a_section_that_is_not_a_table_is_named() -> None:
    values = Actuator.thesis().model_dump() | {"electrical": 3}
    with pytest.raises(ActuatorError, match=r"^rig: 'electrical': .* got 3$"):
        Actuator.from_dict(values, where="rig")


def test_an_error_states_the_number_of_further_errors(tmp_path: Path) -> None:
    path = tmp_path / "actuator.toml"
    Actuator.thesis().to_toml(path)
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("supply = ", "suply = ").replace("inductance = ", "inductence = "), "utf-8")
    # Two misspellings; for each of them, the correct key is missing too.
    assert complaint_about(path).endswith("(and 3 more)")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    assert "no such actuator file" in complaint_about(tmp_path / "absent.toml")


def test_a_binary_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "binary.toml"
    path.write_bytes(bytes(range(256)))
    assert "cannot be read as a TOML text file" in complaint_about(path)


def test_a_directory_is_refused(tmp_path: Path) -> None:
    assert "is a folder" in complaint_about(tmp_path)


def test_a_full_disk_is_reported_with_the_name_of_the_requested_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", "hidden")

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(OutputError, match=r"out\.toml: cannot be written \(No space left on device\)"):
        Actuator.thesis().to_toml(tmp_path / "out.toml")
    assert not list(tmp_path.iterdir())


def test_one_end_stop_is_not_enough(tmp_path: Path) -> None:
    path = tmp_path / "actuator.toml"
    Actuator.thesis().to_toml(path)
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("end_stops = [-0.5236, 0.5236]", "end_stops = [-0.5236]"), encoding="utf-8")
    assert "mechanics.end_stops" in complaint_about(path)


@pytest.mark.parametrize("name", ["flight\x1b.csv", "flight\udcff.csv"])
def test_any_name_of_a_file_is_written_so_that_it_is_read_again(name: str, tmp_path: Path) -> None:
    baseline = Baseline.of(("inertia",), [[1e-4]], (name,))
    unit = Actuator.thesis().model_copy(update={"baseline": baseline})
    unit.to_toml(tmp_path / "unit.toml", comments=f"Calibrated on {name}", ending=name)
    again = Actuator.from_toml(tmp_path / "unit.toml")
    assert again.baseline is not None
    assert again.baseline.recordings == (name.replace("\udcff", "?"),)
    assert "# Calibrated on flight?.csv" in (tmp_path / "unit.toml").read_text(encoding="utf-8")
