"""Measured friction that falls: the trend corrected for speed, and forecasts from past data only."""

import importlib.util
import json
import os
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[1]
SCRIPT = ROOT / "examples" / "xjtu" / "xjtu.py"


@pytest.fixture(scope="module")
def example() -> ModuleType:
    spec = importlib.util.spec_from_file_location("xjtu", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["xjtu"] = module  # dataclasses look up their module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def results(example: ModuleType) -> dict[str, Any]:
    folder = Path(os.environ.get("EMAPHM_DATA", ROOT.parent / "shared" / "data")) / "xjtu"
    path = folder / "friction_torque.csv"
    if not path.is_file():
        pytest.skip(f"the XJTU data are not at {folder}; set EMAPHM_DATA to the folder that holds them")
    vars(example)["EVERY"] = 20  # fewer forecasts per screw are enough here, and faster
    hours, torques = example.read(path)
    screws = [example.judge(name, hours, torques[name], 0.75, 0) for name in torques]
    return {screw.name: json.loads(json.dumps(screw.to_dict(), allow_nan=False)) for screw in screws}


@pytest.mark.parametrize("screw", ["upper", "lower"])
def test_friction_corrected_for_speed_falls(results: dict[str, Any], screw: str) -> None:
    trends = results[screw]["trends_Nm_per_1000h"]
    assert all(trend["falls"] for trend in trends.values())


@pytest.mark.parametrize("screw", ["upper", "lower"])
def test_the_limit_is_passed_within_the_intervals(results: dict[str, Any], screw: str) -> None:
    holds = [forecast["holds"] for forecast in results[screw]["forecasts"] if forecast["holds"] is not None]
    assert holds
    assert all(holds)
    last = results[screw]["forecasts"][-1]["indicator"]
    assert last["laws"]["constant"] < 0.05


def test_a_known_slope_is_found_between_jumps_at_each_speed(example: ModuleType) -> None:
    """A slope of -0.2 hidden by jumps, which speed explains as a covariate of the measurement."""
    hours = 35.0 * np.arange(30)
    number = example.speed_number(hours)
    assert number.tolist()[:10] == [0, 0, 0, 0, 0, 1, 1, 1, 1, 2]
    torque = 0.5 - 0.2e-3 * hours + 0.05 * number + 0.003 * np.random.default_rng(0).standard_normal(30)
    trend = example.trend(hours, torque, number)
    assert abs(trend.slope + 0.2) < trend.half
    assert trend.falls
    assert not example.trend(hours, torque, np.zeros(30)).falls


def test_a_table_of_another_kind_is_refused(
    example: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "table.csv"
    header = "hours,friction_torque_upper,friction_torque_lower\n"
    rows_before = header + "".join(f"{35 * k - 70},0.4,0.5\n" for k in range(30))
    minutes = header + "".join(f"{60 * 35 * k},0.4,0.5\n" for k in range(30))
    for content, message in (
        (rows_before, "hours from -70; count them from 0"),
        (minutes, "30 readings at 30 speeds, less than two a speed"),
        ("hours,torque\n0,1\n", "no column friction_torque_… (the file has: hours, torque)"),
        ("hours,friction_torque_upper,friction_torque_lower\n0,1,1\n", "give more than 8 rows"),
        ("hours,friction_torque_upper,friction_torque_lower\n0,x,1\n", "cannot be read"),
    ):
        path.write_text(content)
        saved, sys.argv = sys.argv, ["xjtu.py", str(path)]
        try:
            assert example.main() == 2
        finally:
            sys.argv = saved
        error = capsys.readouterr().err
        assert message in error
        assert len(error.splitlines()) == 1


def test_a_table_that_begins_later_is_judged_with_a_note(
    example: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "table.csv"
    rows = [f"{35 * k},{0.4 - 0.002 * k},{0.5 - 0.002 * k}" for k in range(1, 30)]
    path.write_text("hours,friction_torque_upper,friction_torque_lower\n" + "\n".join(rows) + "\n")
    hours, torques = example.read(path)
    assert hours[0] == 35.0
    assert torques["lower"].size == 29
    assert "hours begin at 35; the speeds follow from hours since new" in capsys.readouterr().err


def test_a_table_of_one_screw_with_rising_friction_is_accepted(example: ModuleType, tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    path = tmp_path / "another.csv"
    rows = [f"{35 * k},{0.3 + 0.006 * k + 0.002 * random.standard_normal()}" for k in range(20)]
    path.write_text("hours,friction_torque_third\n" + "\n".join(rows) + "\n")
    hours, torques = example.read(path)
    assert list(torques) == ["third"]
    vars(example)["EVERY"] = 20
    screw = example.judge("third", hours, torques["third"], 1.25, 0)
    assert screw.plain.verdict == "rises"
    # 0.375 N·m is passed after 0.075 / 0.006 = 12.5 readings; the first forecast is after nine.
    assert 35 * 11 <= screw.crossed[0] <= screw.crossed[1] <= 35 * 14
    assert screw.holds(screw.forecasts[0])
