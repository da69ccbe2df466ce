"""Actuator descriptions with errors: each is refused in one line that names file, key and remedy."""

from pathlib import Path

import pytest

from . import files
from .conftest import Emaphm, Refusal

MOTOR = files.THESIS.splitlines().index("[motor]") + 1
"""The line of the section in the thesis's description."""

BAD_DESCRIPTIONS: dict[str, tuple[str | bytes, tuple[str, ...]]] = {
    # keys
    "misspelt.toml": (
        files.thesis_with("inertia_motor", "inertia_moter"),
        ("unknown key 'mechanics.inertia_moter'", "did you mean 'inertia_motor'?"),
    ),
    "unknown.toml": (
        files.thesis_with("[motor]", "[motor]\ncolour = 3"),
        ("unknown key 'motor.colour'", "torque_constant, torque_lag, torque_limit"),
    ),
    "section.toml": (files.THESIS + "\n[motr]\n", ("unknown key 'motr'", "did you mean 'motor'?")),
    "channel.toml": (
        files.THESIS + '\n[channels]\ncomand_rad = "qg"\n',
        ("'channels.comand_rad'", "did you mean 'command_rad'?"),
    ),
    "elsewhere.toml": (
        files.thesis_with("[motor]", "[motor]\noffset = 3.0"),
        ("unknown key 'motor.offset' ('offset' is a key of [mechanics]; move it there)",),
    ),
    "no-section.toml": (
        "gear_ratio = 2.0\n" + files.THESIS,
        ("unknown key 'gear_ratio' ('gear_ratio' is a key of [mechanics]; move it there)",),
    ),
    "above.toml": (
        files.thesis_with("[motor]", '[motor]\ncoordinates = "linear"'),
        ("unknown key 'motor.coordinates' ('coordinates' stands above all sections; move it there)",),
    ),
    # A nuisance has the same name, but this section holds properties of the machine.
    "lumped.toml": (
        files.thesis_with("inertia_motor", "inertia"),
        ("unknown key 'mechanics.inertia' (did you mean 'inertia_",),
    ),
    "range.toml": (
        files.THESIS + "\n[reading]\ntimes = [0.5, 2.0]\n",
        ("'reading.times': give a list of ranges", "such as [[0.5, 2.0]], got [0.5, 2.0]"),
    ),
    "missing.toml": (
        files.thesis_with("gear_ratio", "# gear_ratio"),
        ("'mechanics.gear_ratio' is missing", "user motion per motor motion", "add it"),
    ),
    "nothing.toml": ("", ("'name' is missing", "add it")),
    "twice.toml": (
        files.thesis_with("[motor]", "[motor]\ntorque_constant = 1.0"),
        ("not valid TOML", f"line {MOTOR + 2}"),
    ),
    # values
    "negative.toml": (
        files.thesis_with("inertia_motor = 1.3e-05", "inertia_motor = -1.3e-05"),
        ("'mechanics.inertia_motor'", "greater than or equal to 0", "got -1.3e-05"),
    ),
    "zero.toml": (
        files.thesis_with("gear_ratio = 0.002", "gear_ratio = 0.0"),
        ("'mechanics.gear_ratio'", "greater than 0"),
    ),
    "nan.toml": (
        files.thesis_with("resistance = 2.13", "resistance = nan"),
        ("'electrical.resistance'", "finite number", "got nan"),
    ),
    "infinite.toml": (
        files.thesis_with("inductance = 0.00072", "inductance = inf"),
        ("'electrical.inductance'", "finite number", "got inf"),
    ),
    "text.toml": (
        files.thesis_with("gear_ratio = 0.002", 'gear_ratio = "1/500"'),
        ("'mechanics.gear_ratio'", "number", "got '1/500'"),
    ),
    "half-a-pole.toml": (
        files.thesis_with("pole_pairs = 2", "pole_pairs = 2.5"),
        ("'electrical.pole_pairs'", "integer", "got 2.5"),
    ),
    "friction.toml": (
        files.thesis_with("static_friction_motor = 0.10134", "static_friction_motor = 0.0"),
        ("dynamic friction", "must not exceed", "static friction"),
    ),
    "stops.toml": (files.thesis_with("[-0.5236", "[0.6"), ("end_stops [0.6, 0.5236]", "lower one first")),
    "coordinates.toml": (
        files.thesis_with('"rotary"', '"angular"'),
        ("'coordinates'", "'rotary', 'linear' or 'screw'", "got 'angular'"),
    ),
    "sampling.toml": (
        files.THESIS + '\n[channels]\nsampling = "means"\n',
        ("'channels.sampling'", "'mean' or 'instant'", "got 'means'"),
    ),
    "no-table.toml": ("name = 1\ncontroller = 3\n", ("got 1", "more)")),
    "denormal.toml": (
        files.thesis_with("inertia_motor = 1.3e-05", "inertia_motor = 5e-324"),
        ("'mechanics.inertia_motor'", "from 1e-15 to 1e+15", "got 5e-324"),
    ),
    "huge.toml": (
        files.thesis_with("resistance = 2.13", "resistance = 1e300"),
        ("'electrical.resistance'", "from 1e-15 to 1e+15"),
    ),
    "stops-huge.toml": (
        files.thesis_with("[-0.5236", "[-1e300"),
        ("'mechanics.end_stops'", "from 1e-15 to 1e+15"),
    ),
    # files
    "brackets.toml": ("a = " + "[" * 5000, ("not valid TOML", "nested too deeply")),
    "digits.toml": (
        files.thesis_with("pole_pairs = 2", f"pole_pairs = {'9' * 10_000}"),
        ("too many digits",),
    ),
    "large.toml": ("#" * 5_000_000, ("5 MiB", "4 MiB are read at most")),
    "syntax.toml": (
        files.thesis_with("[motor]", "[motor"),
        ("not valid TOML", f"line {MOTOR}", "correct the syntax"),
    ),
    "binary.toml": (bytes(range(256)), ("cannot be read as a TOML text file",)),
    "picture.toml": (files.PNG, ("cannot be read as a TOML text file",)),
    "utf-16.toml": (files.THESIS.encode("utf-16"), ("cannot be read as a TOML text file",)),
    "table.csv": (files.csv(files.columns()), ("not valid TOML", "line 1")),
}


@pytest.mark.parametrize("name", BAD_DESCRIPTIONS)
def test_bad_descriptions_are_refused_in_one_line(refused: Refusal, desk: Path, name: str) -> None:
    content, pieces = BAD_DESCRIPTIONS[name]
    (desk / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    message = refused("diagnose", "good.csv", "--actuator", name)
    for piece in (name, *pieces):
        assert piece in message


@pytest.mark.parametrize(
    "line",
    [
        "diagnose good.csv",
        "replay good.csv",
        "calibrate good.csv --free inertia -o out.toml",
        "simulate out.csv",
    ],
)
@pytest.mark.parametrize(
    ("name", "pieces"),
    [
        ("thsis", ("no such actuator file", "TOML")),
        (
            "absent.toml",
            ("no such actuator file", "bldc, dc, pmsm, six-step, thesis", "give the path of its TOML"),
        ),
        ("six_step", ("no such actuator file", "did you mean 'six-step'?")),
        ("folder.toml", ("is a folder",)),
        ("negative.toml", ("'mechanics.inertia_motor'",)),
    ],
)
def test_all_verbs_refuse_a_bad_description(
    refused: Refusal, desk: Path, line: str, name: str, pieces: tuple[str, ...]
) -> None:
    (desk / "folder.toml").mkdir()
    (desk / "negative.toml").write_bytes(str(BAD_DESCRIPTIONS["negative.toml"][0]).encode())
    message = refused(*line.split(), "--actuator", name)
    for piece in (name, *pieces):
        assert piece in message


def test_a_channel_missing_from_the_file_is_refused(refused: Refusal, desk: Path) -> None:
    (desk / "rig.toml").write_text(files.THESIS + '\n[channels]\ncurrent_A = "vir"\nposition_rad = "qm"\n')
    rig = files.without("position_rad", "current_A") | {"vir": files.columns()["current_A"]}
    (desk / "rig.csv").write_bytes(files.csv(rig))
    message = refused("replay", "rig.csv", "--actuator", "rig.toml")
    for piece in ("no column 'qm'", "[channels]", "position_rad", "take the line out"):
        assert piece in message


def test_parameters_missing_from_the_description_are_refused(refused: Refusal, desk: Path) -> None:
    start, end = files.THESIS.index("[electrical]"), files.THESIS.index("[faults]")
    (desk / "ideal.toml").write_text(files.THESIS[:start] + files.THESIS[end:], encoding="utf-8")
    line = "calibrate good.csv --free resistance -o out.toml --actuator ideal.toml"
    message = refused(*line.split())
    for piece in ("'resistance'", "[electrical]", "leave the parameter out"):
        assert piece in message


@pytest.mark.parametrize("content", [files.THESIS.replace("\n", "\r\n").encode(), files.THESIS.encode()])
def test_the_thesis_actuator_from_a_file_equals_the_built_in_one(
    emaphm: Emaphm, desk: Path, content: bytes
) -> None:
    (desk / "thesis ü.toml").write_bytes(content)
    assert emaphm("replay", "good.csv", "--actuator", "thesis ü.toml") == emaphm("replay", "good.csv")


def test_a_byte_order_mark_is_accepted(emaphm: Emaphm, desk: Path) -> None:
    (desk / "notepad.toml").write_bytes(b"\xef\xbb\xbf" + files.THESIS.encode())
    assert emaphm("replay", "good.csv", "--actuator", "notepad.toml").code == 0
