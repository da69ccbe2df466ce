"""A measured run to a jam: alarm, false alarms and remaining useful life, from past data only.

Mazzoleni, Scandella, Previdi, Pispola, Data in Brief 29:105153 (2020): no lubricant from 2 October 2017 on, a
jam after 13 October.
"""

import importlib.util
import json
import os
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import polars as pl
import pytest

ROOT = Path(__file__).resolve().parents[1]
SCRIPT = ROOT / "examples" / "reprise" / "reprise.py"


@pytest.fixture(scope="module")
def example() -> ModuleType:
    spec = importlib.util.spec_from_file_location("reprise", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["reprise"] = module  # dataclasses look up their module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def frame(example: ModuleType) -> pl.DataFrame:
    folder = Path(os.environ.get("EMAPHM_DATA", ROOT.parent / "shared" / "data")) / "reprise"
    path = folder / "phase_current_features_5mm.csv"
    if not path.is_file():
        pytest.skip(f"the REPRISE data are not at {folder}; set EMAPHM_DATA to the folder that holds them")
    table: pl.DataFrame = example.read(path)
    return table


@pytest.fixture(scope="module")
def judged(example: ModuleType, frame: pl.DataFrame) -> dict[str, Any]:
    return dict(example.judge(frame).to_dict())


def test_the_jam_is_predicted_without_false_alarms(judged: dict[str, Any]) -> None:
    run = json.loads(json.dumps(judged, allow_nan=False))
    assert (run["first_alarm"], run["false_alarms"]) == ("2017-10-02", 0)
    # The publication's own medians.
    assert [round(day["rms_A"], 2) for day in run["tests"][-3:]] == [5.82, 7.25, 7.48]
    assert [day["holds_jam"] for day in run["tests"][-3:]] == [True] * 3
    assert all(day["alarm"] for day in run["tests"][-3:])


def test_the_result_of_a_day_does_not_depend_on_later_days(
    example: ModuleType, frame: pl.DataFrame, judged: dict[str, Any]
) -> None:
    shorter = frame.filter(pl.col("date") <= example.date(2017, 9, 18))
    now, then = judged["tests"], example.judge(shorter).to_dict()["tests"]
    assert then == now[: len(then)]


def ask(
    example: ModuleType, capsys: pytest.CaptureFixture[str], *arguments: str | Path
) -> tuple[int, str, str]:
    capsys.readouterr()
    saved, sys.argv = sys.argv, ["reprise.py", *map(str, arguments)]
    try:
        code = example.main()
    finally:
        sys.argv = saved
    return code, *capsys.readouterr()


WRONG = {
    "no column condition": "date,frequency_hz,rms_A\n2017-10-02,1.0,2.5\n",
    "give dates as": "date,condition,frequency_hz,rms_A\nsoon,normal,1.0,2.5\n",
    "no sinusoid of 1 Hz": "date,condition,frequency_hz,rms_A\n2017-10-02,normal,2.0,2.5\n",
    "row 2 of column 'rms_A' is empty": (
        "date,condition,frequency_hz,rms_A\n2017-10-02,normal,1.0,2.5\n2017-10-02,normal,1.0,\n"
    ),
    "divide it by 1,000 if it is in mA": (
        "date,condition,frequency_hz,rms_A\n2017-10-02,normal,1.0,2510\n2017-10-02,normal,1.0,2490\n"
    ),
    "1 of 1 tests are of the condition 'normal' first": (
        "date,condition,frequency_hz,rms_A\n2017-10-02,normal,1.0,2.5\n"
    ),
}


@pytest.mark.parametrize("message", WRONG)
def test_a_table_of_another_kind_is_refused(
    example: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str], message: str
) -> None:
    path = tmp_path / "table.csv"
    path.write_text(WRONG[message])
    code, out, err = ask(example, capsys, path)
    assert (code, out) == (2, "")
    assert message in err
    assert len(err.splitlines()) == 1
    assert ask(example, capsys, tmp_path / "none.csv")[0] == 2


def test_the_limit_is_a_robust_maximum_of_the_current_and_not_a_single_period(
    example: ModuleType, frame: pl.DataFrame, judged: dict[str, Any]
) -> None:
    healthy = frame.filter(pl.col("date") <= example.date(2017, 6, 21))
    fast = healthy.filter(pl.col("frequency_hz") == 4.0)["rms_A"].to_list()
    # Of 404 periods, 1 % is four.
    assert sorted(fast)[-6] <= judged["fails_at_A"] <= sorted(fast)[-4]
    wrong = pl.int_range(pl.len()) == frame["frequency_hz"].index_of(4.0)
    spoilt = frame.with_columns(rms_A=pl.when(wrong).then(400.0).otherwise(pl.col("rms_A")))
    assert example.most_current(spoilt, example.date(2017, 6, 21), 1.0) < max(fast)


def test_an_empty_period_matters_only_at_its_own_frequency(
    example: ModuleType, tmp_path: Path, judged: dict[str, Any], frame: pl.DataFrame
) -> None:
    spoilt = frame.with_columns(
        rms_A=pl.when(pl.int_range(pl.len()) == frame["frequency_hz"].index_of(2.0))
        .then(float("nan"))
        .otherwise(pl.col("rms_A"))
    )
    spoilt.write_csv(tmp_path / "spoilt.csv")
    table = example.read(tmp_path / "spoilt.csv", 1.0)
    assert table.height == frame.height - 1
    assert [day.rms for day in example.tests_of(table, 1.0)] == [day["rms_A"] for day in judged["tests"]]
    with pytest.raises(example.RecordingError, match="of column 'rms_A' is empty"):
        example.read(tmp_path / "spoilt.csv", 2.0)


def test_data_without_a_usable_healthy_state_are_refused(example: ModuleType, frame: pl.DataFrame) -> None:
    error = example.RecordingError
    with pytest.raises(error, match="200 periods of the condition 'no_lubricant', where 100 are usual"):
        example.judge(frame.with_columns(pl.col("condition").str.replace("_[0-9]$", "")))
    with pytest.raises(error, match="0 of 16 tests are of the condition 'normal' first"):
        example.judge(frame.with_columns(condition="worn_" + pl.col("condition")))
    with pytest.raises(error, match="no sinusoid above 1 Hz on the healthy days"):
        example.judge(frame.filter(pl.col("frequency_hz") == 1.0))
    for level in (2.0, -1.0, float("nan")):
        with pytest.raises(error, match=r"where 2\.5 A are healthy; give more with --fails-at"):
            example.judge(frame, fails_at=level)


@pytest.mark.parametrize("day", [(2017, 4, 18), (2017, 5, 23)])
def test_the_next_condition_is_judged_despite_a_missing_healthy_day(
    example: ModuleType, frame: pl.DataFrame, day: tuple[int, int, int]
) -> None:
    run = example.judge(frame.filter(pl.col("date") != example.date(*day)))
    assert run.monitored[0].test.day == example.date(2017, 7, 31)
    # As stated on the page for these days.
    assert run.first_alarm == example.date(2017, 10, 9)
    assert [item.holds_jam for item in run.judged[-3:]] == [True] * 3
