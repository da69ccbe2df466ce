"""Wrong units are found; correct recordings of healthy and faulty actuators raise no complaint."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from emaphm.actuator import Actuator
from emaphm.recording import Recording, check_plausible, read_recording

from .conftest import Columns, Refusal

DEGREES = 180 / np.pi


def _scaled(factors: dict[str, float]) -> Callable[[Columns], Columns]:
    return lambda columns: {**columns, **{name: columns[name] * factor for name, factor in factors.items()}}


WRONG = {
    "time in ms": (_scaled({"time_s": 1e3}), ["0.2 s apart", "milliseconds"]),
    "time in µs": (_scaled({"time_s": 1e6}), ["200 s apart", "if time_s is in microseconds convert"]),
    "time in ns": (_scaled({"time_s": 1e9}), ["2e+05 s apart", "if time_s is in nanoseconds convert"]),
    "time in Ms": (_scaled({"time_s": 1e-6}), ["2e-10 s apart", "time_s must be in s"]),
    "both in millidegrees": (
        _scaled({"command_rad": 1e3 * DEGREES, "position_rad": 1e3 * DEGREES}),
        ["command_rad reaches 286.5", "end stops are at 0.5236", "degrees", "convert it to rad"],
    ),
    "position in degrees": (
        _scaled({"position_rad": DEGREES}),
        ["57.3 times", "position_rad seems to be in degrees", "rad"],
    ),
    "position in mrad": (_scaled({"position_rad": 1e3}), ["position_rad", "milliradians"]),
    "command in degrees": (_scaled({"command_rad": DEGREES}), ["command_rad seems to be in degrees"]),
    "current in mA": (
        _scaled({"current_A": 1e3}),
        ["current_A reaches", "current limit is 22.5", "milliamperes"],
    ),
    "current in kA": (_scaled({"current_A": 1e-3}), ["current_A stays below", "kiloamperes"]),
    "dead current sensor": (_scaled({"current_A": 0.0}), ["current_A is 0 throughout", "check the sensor"]),
    "voltage in mV": (
        lambda columns: {**columns, "voltage_V": 24e3 * np.sign(columns["current_A"])},
        ["voltage_V reaches 2.4e+04 at row 1,", "supply is 48", "millivolts"],
    ),
    "one absurd voltage": (
        lambda columns: {**columns, "voltage_V": np.where(np.arange(2500) == 41, 1e308, 24.0)},
        ["voltage_V reaches 1e+308 at row 42,", "convert it to V"],
    ),
    "voltage of nothing": (
        lambda columns: {**columns, "voltage_V": 1e-300 * columns["current_A"]},
        ["voltage_V reaches only", "no sensor resolves", "leave the column out"],
    ),
    "an absurd angle": (
        lambda columns: {**columns, "angle_rad": np.where(np.arange(2500) == 41, -1e300, 24.0)},
        ["angle_rad reaches 1e+300 at row 42,", "correct that value"],
    ),
    "load at the user": (
        lambda columns: {**columns, "load_Nm": np.full(2500, -500.0)},
        ["load_Nm reaches 500 at row 1,", "the motor holds 1.692", "refer it to the motor shaft"],
    ),
    "temperature in mK": (_scaled({"temperature_K": 1e3}), ["temperature_K reaches", "convert it to K"]),
    "speed far too small": (_scaled({"speed_rad_s": 1e-4}), ["speed_rad_s stays below", "on average"]),
    "speed far too large": (_scaled({"speed_rad_s": 1e3}), ["speed_rad_s reaches", "rpm"]),
    "Celsius": (
        lambda columns: {**columns, "temperature_K": columns["temperature_K"] - 273.15},
        ["temperature_K is 20 at row 1;", "add 273.15"],
    ),
}


@pytest.mark.parametrize(("change", "expected"), WRONG.values(), ids=WRONG.keys())
def test_a_wrong_unit_is_named(
    columns: Columns,
    thesis: Actuator,
    refusal: Refusal,
    change: Callable[[Columns], Columns],
    expected: list[str],
) -> None:
    check_plausible(Recording(columns), thesis)
    bad = Recording(change(columns), source="rig 3")
    text = refusal(lambda: check_plausible(bad, thesis))
    assert text.startswith("rig 3: ")
    for part in expected:
        assert part in text


@pytest.mark.parametrize(
    ("rows", "interval", "piece"),
    [(200_001, 1e-4, "has 200,001 rows"), (60_000, 0.01, "takes 600 s, a model is fitted to 500 s")],
)
def test_a_long_recording_is_refused_with_the_remedy(
    thesis: Actuator, refusal: Refusal, rows: int, interval: float, piece: str
) -> None:
    ones = np.ones(rows)
    long = Recording({"time_s": interval * np.arange(rows), "command_rad": 1e-3 * ones, "current_A": ones})
    text = refusal(lambda: check_plausible(long, thesis))
    assert piece in text
    assert "cut one manoeuvre out of it" in text


def test_the_row_of_a_spike_is_named(columns: Columns, thesis: Actuator, refusal: Refusal) -> None:
    columns["current_A"][122] = -5000.0
    assert "at row 123," in refusal(lambda: check_plausible(Recording(columns), thesis))


@pytest.mark.parametrize(
    ("name", "level", "expected"),
    [
        ("duty", 100.0, ["duty reaches 100", "percent or raw counts", "divide it"]),
        ("supply_V", 48e3, ["supply_V reaches", "millivolts", "convert it to V"]),
        ("voltage_q_V", 48e3, ["voltage_q_V reaches", "convert it to V"]),
        ("current_q_A", 2e3, ["current_q_A reaches", "milliamperes", "convert it to A"]),
        ("enabled", 255.0, ["enabled is 255 at row 1;", "1 where the drive is switched on"]),
    ],
)
def test_further_channels_of_a_drive_are_checked(
    columns: Columns, thesis: Actuator, refusal: Refusal, name: str, level: float, expected: list[str]
) -> None:
    bad = Recording({**columns, name: np.full(2500, level)})
    text = refusal(lambda: check_plausible(bad, thesis))
    for part in expected:
        assert part in text
    check_plausible(Recording({**columns, name: np.ones(2500)}), thesis)


def test_a_message_on_a_linear_actuator_has_its_unit(
    columns: Columns, emps: Actuator, refusal: Refusal
) -> None:
    alone = {name: columns[name] for name in ("time_s", "current_A")}
    bad = Recording({**alone, "command_rad": 1e20 * columns["command_rad"]})
    assert "convert the column to m (" in refusal(lambda: check_plausible(bad, emps))


def test_phase_currents_are_checked(columns: Columns, thesis: Actuator, refusal: Refusal) -> None:
    bad = Recording({**columns, "current_b_A": 1e3 * columns["current_A"]})
    assert "current_b_A reaches" in refusal(lambda: check_plausible(bad, thesis))


SOUND = {
    "as recorded": {},
    "jammed: the position only jitters": {"position_rad": 1e-6},
    "jammed far from the command": {"position_rad": 0.4},
    "never left its backlash": {"position_rad": 0.0},
    "idling: too little current to move": {"position_rad": 0.0, "current_A": 1e-4},
}


@pytest.mark.parametrize("levels", SOUND.values(), ids=SOUND.keys())
def test_faults_are_not_mistaken_for_units(
    columns: Columns, thesis: Actuator, levels: dict[str, float]
) -> None:
    rng = np.random.default_rng(0)
    changed = {name: level + 1e-6 * rng.normal(size=2500) for name, level in levels.items()}
    check_plausible(Recording({**columns, **changed}), thesis)


def test_values_near_the_largest_float_are_checked_without_overflow(
    columns: Columns, emps: Actuator, refusal: Refusal
) -> None:
    bad = Recording({**columns, "position_rad": columns["command_rad"] * 1e300})
    assert "micrometres" in refusal(lambda: check_plausible(bad, emps))


def test_measured_data_in_metres_are_plausible_and_in_millimetres_are_not(
    emps_file: Path, emps: Actuator, refusal: Refusal
) -> None:
    recording = read_recording(emps_file, emps)
    check_plausible(recording, emps)
    scaled = Recording({**recording.channels, "position_rad": 1e3 * recording["position_rad"]})
    text = refusal(lambda: check_plausible(scaled, emps))
    assert "position_rad seems to be in millimetres: convert it to m" in text
