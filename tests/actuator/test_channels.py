"""`[channels]` and `[reading]` of a description: units, short forms, and errors that name the key."""

import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from emaphm.actuator import Actuator
from emaphm.actuator.channels import Channels
from emaphm.actuator.columns.units import in_unit
from emaphm.actuator.toml import write_toml
from emaphm.errors import ActuatorError

THESIS = write_toml(Actuator.thesis())


@pytest.mark.parametrize(
    ("unit", "target", "of_two"),
    [
        ("mm", "m", 2e-3),
        ("deg", "rad", np.pi / 90),
        ("°", "rad", np.pi / 90),
        ("turn", "rad", 4 * np.pi),
        ("rpm", "rad/s", 2 * np.pi / 30),
        ("1/min", "rad/s", 2 * np.pi / 30),
        *((unit, "rad/s", 2 * np.pi / 30) for unit in ("min⁻¹", "rev/min", "r/min", "U/min", "RPM")),
        ("rev/s", "rad/s", 4 * np.pi),
        ("degC", "K", 275.15),
        ("%", "-", 0.02),
        ("kgf*m", "N·m", 2 * 9.80665),
        ("mNm", "N·m", 2e-3),
        ("Ncm", "N·m", 2e-2),
        ("µs", "s", 2e-6),
    ],
)
def test_units_of_channels_are_converted(unit: str, target: str, of_two: float) -> None:
    np.testing.assert_allclose(in_unit(np.array([2.0]), unit, target), of_two, rtol=1e-12)


@pytest.mark.parametrize(("unit", "target"), [("percent", "rad"), ("Hz", "rad/s"), ("mm", "rad"), ("C", "K")])
def test_a_unit_of_another_quantity_is_refused(unit: str, target: str) -> None:
    with pytest.raises(ValueError, match="does not convert"):
        in_unit(np.ones(1), unit, target)


def described(lines: str) -> Actuator:
    return Actuator.from_dict(tomllib.loads(f"{THESIS}\n{lines}"), where="odd.toml")


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ("[channels]\ncurrent_A = { colum = 'I' }", ["channels.current_A.colum", "did you mean 'column'"]),
        ("[channels]\ncurrent_A = { unit = 'mmm' }", ["channels.current_A.unit", "did you mean 'mm'"]),
        ("[channels]\npostion_rad = 'I'", ["channels.postion_rad", "did you mean 'position_rad'"]),
        ("[channels]\ncurrent_A = true", ["channels.current_A", "the name of a column"]),
        ("[channels]\ncurrent_A = { sign = 2 }", ["channels.current_A.sign", "1 or -1"]),
        ("[channels]\ncurrent_A = { scale = 0 }", ["channels.current_A", "scale of 0"]),
        ("[channels]\ncurrent_A = { column = 'I', derived = 'a - b' }", ["column and derived", "keep one"]),
        ("[channels]\ncurrent_A = { derived = 'a ** b' }", ["channels.current_A.derived", "not allowed"]),
        ("[channels]\nload_Nm = { value = 1.0, delay_s = 0.1 }", ["channels.load_Nm", "has no time"]),
        ("[channels]\ntime_s = 0.0", ["channels.time_s", "a column of its own"]),
        ("[reading]\nkeep = 'x ='", ["reading.keep", "cannot be parsed"]),
        ("[reading]\ntimes = [[2.0, 1.0]]", ["reading.times", "is empty"]),
        ("[reading]\nlow_pas_hz = 3.0", ["reading.low_pas_hz", "did you mean 'low_pass_hz'"]),
        ("[reading]\nlongest_gap = -1", ["reading.longest_gap", "greater than or equal to 0"]),
    ],
)
def test_an_error_names_the_key_and_the_remedy(lines: str, expected: list[str]) -> None:
    with pytest.raises(ActuatorError) as caught:
        described(lines)
    for part in ("odd.toml", *expected):
        assert part in str(caught.value)
    assert "\n" not in str(caught.value)


LONG = """
[channels]
sampling = "instant"
time_s = "t"
command_rad = { column = "set point", unit = "deg", sign = -1 }
position_rad = { derived = "set - error", unit = "deg", delay_s = 2e-3 }
load_Nm = 0.05

[reading]
keep = "enable == 1"
times = [[0.5, 4.0], [6.0, 8.0]]
split = "run"
"""


def test_written_channels_are_read_back(tmp_path: Path) -> None:
    actuator = described(LONG)
    actuator.to_toml(tmp_path / "a.toml")
    assert Actuator.from_toml(tmp_path / "a.toml") == actuator
    assert actuator.channels.load_Nm.value == 0.05
    assert actuator.channels.time_s == Channels(time_s="t").time_s


def test_the_library_of_units_is_loaded_only_if_a_unit_is_given() -> None:
    check = (
        "import sys, emaphm.cli.command_line, emaphm.diagnosis.diagnose; "
        "from emaphm.actuator import Actuator; Actuator.thesis(); assert 'pint' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", check], check=True)  # noqa: S603 - this Python
