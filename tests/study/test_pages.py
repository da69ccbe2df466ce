"""The pages of the studies `accuracy` and `limits`: rates, requirements, overconfident settings, figures."""

import math
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from emaphm.actuator import NAMES
from emaphm.cli import main
from emaphm.errors import StudyError
from emaphm.report.accuracy_page import accuracy_page
from emaphm.report.drive_page import drive_page
from emaphm.report.limits_page import limits_page
from emaphm.report.markdown import percent
from emaphm.study import Plan, Store
from emaphm.study.analysis.limits import SettingRates
from emaphm.study.analysis.rates import (
    alarms,
    chance_interval,
    coverage,
    covered,
    detection,
    errors,
    false_alarms,
    half_widths,
    holds,
    least_by_chance,
    quantiles,
    recordings_alarmed,
    single_fault,
)
from emaphm.study.plan import PageRow
from emaphm.study.store import SCHEMA
from emaphm.study.trials import Trial

from .made_up import HEALTHY, results


@cache
def made(name: str) -> tuple[Plan, pl.DataFrame]:
    """Return a plan and made-up results for a share of its trials."""
    plan = Plan.load(name)
    return plan, results(plan)


@pytest.fixture(scope="module")
def accuracy() -> Plan:
    return made("accuracy")[0]


@pytest.fixture(scope="module")
def limits() -> Plan:
    return made("limits")[0]


# Rates


def frame(*rows: dict[str, Any]) -> pl.DataFrame:
    default = {
        "truth": HEALTHY,
        "lower95": [v - 0.01 for v in HEALTHY],
        "upper95": [v + 0.01 for v in HEALTHY],
        "verdict": ["healthy"] * 8,
        "explained": True,
        "error_percent": 0.2,
    }
    schema = {name: SCHEMA[name] for name in default}
    return pl.DataFrame([default | values for values in rows], schema=schema)


def called(*names: str) -> list[str]:
    return ["degraded" if name in names else "healthy" for name in NAMES]


def test_a_phase_interval_may_cross_the_end_of_its_circle() -> None:
    def both(truth: float, low: float, high: float) -> list[bool]:
        """Return whether an interval of the phase and of the gain holds the truth."""
        ends = [*[0.0] * 6, low, low], [*[0.0] * 6, high, high]
        rows = frame({"truth": [*[0.0] * 6, truth, truth], "lower95": ends[0], "upper95": ends[1]})
        return list(map(bool, covered(rows)[0, 6:]))

    assert both(0.02, 0.95, 1.05) == [True, False]
    assert both(0.98, -0.05, 0.05) == [True, False]
    assert both(0.5, 0.95, 1.05) == [False, False]
    assert both(1.0, 0.95, 1.05) == [True, True]


@pytest.mark.parametrize("name", NAMES)
def test_an_interval_of_an_amplitude_does_not_wrap_around(name: str) -> None:
    """An interval at one end of the range holds the other end only for a direction."""
    is_direction = name == "eccentricity_phase"
    assert bool(holds(name, (0.9, 1.0), 0.0)) == is_direction
    assert bool(holds(name, (0.0, 0.1), 1.0)) == is_direction
    assert holds(name, (0.9, 1.0), 0.95)
    assert not holds(name, (0.9, 1.0), 0.5)


def test_rates_are_the_counts_of_their_names() -> None:
    short = [0.0, 0.0, 0.0, 0.05, 0.0, 0.0, 0.5, 0.5]
    intervals = {"truth": short, "lower95": [v - 0.01 for v in short], "upper95": [v + 0.01 for v in short]}
    row = intervals | {"verdict": called("short_b", "gain")}
    missed = intervals | {
        "lower95": [0.1, *intervals["lower95"][1:]],
        "upper95": [0.2, *intervals["upper95"][1:]],
    }
    # The phase shares the eccentricity's verdict and is not counted twice.
    crying = {"verdict": called("eccentricity", "eccentricity_phase")}
    several = frame(row, missed, crying, {})
    assert detection(frame(row, missed)) == 0.5
    assert false_alarms(several) == 2 / (6 + 6 + 7 + 7)
    assert recordings_alarmed(several) == 0.5
    assert alarms(several).sum() == 3
    np.testing.assert_array_equal(coverage(several), [0.75] + [1.0] * 7)
    np.testing.assert_allclose(half_widths(several)[1], [0.05] + [0.01] * 7)


def test_quantiles_are_the_median_the_95th_percentile_and_the_worst() -> None:
    assert quantiles(np.arange(101.0)) == "50.00 / 95.00 / 100.00"
    assert errors(frame({"error_percent": 3.0}, {})).tolist() == [3.0, 0.2]


@pytest.mark.parametrize(
    ("truth", "fault"),
    [
        ([0.0, 0.0, 0.0, 0.05, 0.0, 0.0, 0.5, 0.5], ("short", 0.05)),
        ([0.0, 0.0, 0.0, 0.0, 0.0, 0.05, 0.9, 0.5], ("eccentricity", 0.05)),
        ([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.4], ("gain", 0.1)),
    ],
)
def test_single_faults_are_recognised(truth: list[float], fault: tuple[str, float]) -> None:
    assert single_fault(truth) == fault


@pytest.mark.parametrize("count", [8, 20, 300])
def test_the_chance_is_from_the_binomial_distribution(count: int) -> None:
    def at_most(held: int) -> float:
        return sum(math.comb(count, k) * 0.95**k * 0.05 ** (count - k) for k in range(held + 1))

    least = round(count * least_by_chance(count))
    assert at_most(least - 1) < 1e-3 <= at_most(least)
    low, high = (round(count * end) for end in chance_interval(count))
    assert at_most(low - 1) < 0.025 <= at_most(low)
    assert at_most(high - 1) < 0.975 <= at_most(high)


# The page of accuracy


def verdicts(page: str) -> list[str]:
    """Return the last column of the first table."""
    lines = page[page.index("| quantity |") :].splitlines()
    rows = lines[2 : lines.index("")]
    return [line.rsplit("|")[-2].strip() for line in rows]


def test_the_first_table_says_no_if_a_requirement_is_not_met(accuracy: Plan) -> None:
    _, runs = made("accuracy")
    page = accuracy_page(accuracy, runs)
    # Intervals that always hold the truth are not within 92 to 98 %.
    assert verdicts(page) == ["yes"] * 5 + ["no"] * 2 + ["yes", "–"]
    assert f"{runs.height} of 3110 runs" in page
    disturbed = (pl.col("rig") == "switching disturbed") & (pl.col("run") == 0)
    healthy = (pl.col("case_kind") == "healthy") & (pl.col("rig") == "current and line voltage")
    changed = runs.with_columns(
        pl.when(disturbed).then(2.5).otherwise("error_percent").alias("error_percent"),
        pl.when(healthy).then(pl.lit(called("backlash"))).otherwise("verdict").alias("verdict"),
    )
    page = accuracy_page(accuracy, changed)
    assert "0 of 1, the worst 2.50 % | no |" in page
    assert "≤ 0.5 % | 14.29 % | no |" in page
    assert "raised by" in page
    assert "backlash 50" in page


def test_the_page_has_all_rows_of_its_sections_and_both_sizes(accuracy: Plan) -> None:
    page = accuracy_page(*made("accuracy"))
    for section in accuracy.sections:
        for row in section.rows:
            assert f"| {row.text}" in page
    assert "| current and line voltage, 5 % | 5 | 100 % | 100 % | 100 % | 100 % | 100 % | 0.00 % |" in page
    assert "| current and line voltage, 10 % | 3 |" in page
    assert "| current alone, 5 % | 2 |" in page
    assert "0.05 A of noise on the current, all channels through 12-bit converters" in page
    complete = results(accuracy, 1.0)
    assert "not complete" not in accuracy_page(accuracy, complete)


def test_heavy_shorts_in_which_nothing_moves_have_no_error(accuracy: Plan) -> None:
    page = accuracy_page(accuracy, made("accuracy")[1].with_columns(moves=pl.lit(value=False)))
    assert "| 0 of 6 | – | – | – | – | – |" in page


def test_a_page_without_results_is_refused(accuracy: Plan, limits: Plan) -> None:
    runs = made("accuracy")[1]
    for kind, row in (("heavy", "0"), ("small", "current and line voltage")):
        with pytest.raises(StudyError, match=f"no run of '{row}' with {kind} cases is finished"):
            accuracy_page(accuracy, runs.filter(pl.col("case_kind") != kind))
    runs = made("limits")[1].filter(pl.col("rig") != "8 bits")
    with pytest.raises(StudyError, match="no run of '8 bits' with random cases is finished"):
        limits_page(limits, runs, "limits")


# The map of the limits

DRAWN = {"noise"}
"""One of eight similar figures of the map; only one, because drawing takes long."""


def test_the_map_names_the_overconfident_settings(limits: Plan) -> None:
    undrawn = [section.model_copy(update={"figure": ""}) for section in limits.sections]
    page, none = limits_page(limits.model_copy(update={"sections": undrawn}), made("limits")[1], "limits")
    assert none == {}
    assert "336 of 1512 runs" in page
    assert "none of 42." in page
    explained = {"8 bits": False, "10 bits": True}

    def miss_the_gain(trial: Trial) -> dict[str, Any]:
        rig = trial.rig.label if trial.rig else ""
        if trial.case_kind != "random" or rig not in explained:
            return {}
        low, high = ([*(v + side for v in trial.truth[:7]), 2.0 + side] for side in (-0.01, 0.01))
        return {"lower95": low, "upper95": high, "error_percent": 7.25, "explained": explained[rig]}

    drawn = [
        section if section.figure in DRAWN else section.model_copy(update={"figure": ""})
        for section in limits.sections
    ]
    few = limits.model_copy(update={"sections": drawn})
    page, figures = limits_page(few, results(limits, 1.0, miss_the_gain), "limits")
    assert "1 of 42." in page
    assert (
        "- bits: 10: the 95 % interval of gain contains the truth in 0 % of the cases, 100 % of the "
        "recordings are explained, median error 7.25 %" in page
    )
    assert "- bits: 8" not in page
    assert "| 8 | 7.25 / 7.25 | 88 % | 0 % (gain) | 0 % |" in page
    assert figures.keys() == DRAWN
    for name, content in figures.items():
        assert content.startswith(b"<?xml")
        assert f"](limits/{name}.svg)" in page


def test_the_base_setting_is_diagnosed_once_for_all_sections(limits: Plan) -> None:
    through_base = [
        row
        for section in limits.sections
        for row in section.rows
        if (row.rig, row.method) == ("base", "default")
    ]
    # In the table of channels, and on all axes but temperature, which the base setting draws.
    assert len(through_base) == 1 + 7
    settings = {(row.rig, row.method) for section in limits.sections for row in section.rows}
    # 46 points on the axes, six of them the base setting again; two more channels.
    assert len(settings) == 46 - 6 + 2
    assert limits.total == 42 * (20 + 2 * 5 + 6)


def test_foreign_plants_have_a_page_of_the_same_form() -> None:
    plan, runs = made("plants")
    page, figures = limits_page(plan, runs, "plants")
    assert page.startswith("# Plants that are not as described\n")
    assert figures == {}
    # The base setting, 22 foreign plants, 14 also with calibrated laws, all with selected laws.
    assert "none of 60." in page
    assert plan.total == 60 * (5 + 1 * 5 + 2)


def test_varying_loads_have_a_page_of_the_same_form() -> None:
    plan = Plan.load("loads")
    page, figures = limits_page(plan, results(plan), "loads")
    assert page.startswith("# Loads that vary\n")
    assert figures == {}
    assert "none of 14." in page


def test_rates_are_those_of_the_results(limits: Plan) -> None:
    runs = results(limits, 1.0)
    base = (pl.col("rig") == "base") & (pl.col("case_kind") == "random") & (pl.col("method") == "default")
    runs = runs.with_columns(
        pl.when(base).then(pl.col("seed").cast(pl.Float64)).otherwise("error_percent").alias("error_percent")
    )
    rates = SettingRates.of(PageRow(text="", rig="base", method="default"), runs)
    assert rates.median == 9.5
    assert rates.p95 == pytest.approx(0.95 * 19)
    assert (rates.detection, rates.false_alarms, rates.cases) == (1, 0, 20)
    assert rates.mean_coverage == rates.least_coverage == 1


def test_units_and_data_sheets_have_a_page_of_the_same_form() -> None:
    plan = Plan.load("data_sheets")
    page, figures = limits_page(plan, results(plan), "data_sheets")
    assert figures == {}
    assert page.startswith("# A unit and its data sheet\n")
    assert [line.split(" |")[0] for line in page.splitlines() if line.startswith("| tolerances")] == [
        "| tolerances, taken as exact",
        "| tolerances stated",
    ]


# Both pages by the command


TINY = """\
name = "tiny"
page = "limits"
runs = 1

[manoeuvre]
duration = 0.05

[[methods]]
method = "hybrid"
turns = 0

[[rigs]]
label = "base"

[[groups]]
label = "all"
random = 1
healthy = 1
small = [{ size = 0.05, count = 1 }]

[[sections]]
title = "Noise"
label = "noise, A"
figure = "noise"
rows = [{ text = "0.05", rig = "base", method = "hybrid" }]
"""


def test_the_command_writes_the_page_and_its_figures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "tiny.toml").write_text(TINY, encoding="utf-8")
    study, out = str(tmp_path / "study"), tmp_path / "docs"
    assert main(["study", "run", str(tmp_path / "tiny.toml"), "-o", study, "--workers", "1"]) == 0
    assert Store.open(study).results.height == 7
    assert main(["study", "report", study, "-o", str(out)]) == 0
    page = (out / "limits.md").read_text(encoding="utf-8")
    assert "![noise](limits/noise.svg)" in page
    assert (out / "limits" / "noise.svg").is_file()
    assert "0.05 s chirp at 5 kHz" in page
    assert f"written: {out / 'limits.md'}" in capsys.readouterr().out


# Drives


def test_the_page_of_a_drive_has_a_dash_for_cases_missing_in_the_plan() -> None:
    plan, runs = made("pmsm")

    def wrong_by_a_case(trial: Trial) -> dict[str, Any]:
        return {"error_percent": {"named": 0.5, "random": 0.25}.get(trial.case_kind, 0.125)}

    page = drive_page(plan, results(plan, 1.0, wrong_by_a_case))
    assert "not complete" not in page
    assert "| noise-free | 0.5 / 0.5 | 0.25 / 0.25 / 0.25 | 200 | 100 % | 100 % | – | – |" in page
    base = "| base setting: current and line voltage | – | 0.25 / 0.25 / 0.25 | 200 | 100 % | 100 % | 100 % |"
    assert f"{base} 0.0 % |" in page
    with pytest.raises(StudyError, match="no run of 'noise-free' with random cases"):
        drive_page(plan, runs.filter(pl.col("case_kind") != "random"))
    with pytest.raises(StudyError, match="needs"):
        drive_page(plan.model_copy(update={"sections": ()}), runs)


@pytest.mark.parametrize(
    ("share", "text"),
    [(0.0, "0 %"), (0.001, "0.1 %"), (0.29, "29 %"), (0.99, "99 %"), (0.9967, "99.7 %"), (1.0, "100 %")],
)
def test_a_share_is_printed_as_0_or_100_percent_only_if_exact(share: float, text: str) -> None:
    assert percent(share) == text


@pytest.mark.parametrize("name", ["accuracy", "plants", "pmsm"])
def test_a_page_states_that_results_of_several_versions_are_mixed(name: str) -> None:
    (plan, made_up), page_functions = made(name), {"accuracy": accuracy_page, "pmsm": drive_page}

    def page(runs: pl.DataFrame) -> str:
        return (
            page_functions[name](plan, runs) if name in page_functions else limits_page(plan, runs, name)[0]
        )

    assert "mixed" not in page(made_up)
    first = pl.col("index") == made_up["index"].min()
    two = made_up.with_columns(
        pl.when(first).then(pl.lit("ba9876543210")).otherwise("revision").alias("revision")
    )
    expected = "> **Results of 2 versions of the models are mixed: 0123456789ab, ba9876543210."
    assert expected in page(two)
