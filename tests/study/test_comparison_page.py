"""The page that repeats the thesis's comparison: numbers agree with the studies, and findings are checked."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import polars as pl
import pytest

from emaphm.errors import StudyError
from emaphm.report import comparison_page
from emaphm.report.comparison_page import PLANS, finished, write_comparison
from emaphm.study import Plan, Store

from .made_up import results

ERRORS = {"GA": 2.2, "PSO": 1.2, "DE": 1.0, "GWO": 4.0, "DA": 3.0, "DA as listed": 20.0, "hybrid": 0.3}
"""Mean errors [%] for single faults with which the findings in the page's text hold."""

SEARCHED = dict.fromkeys(("lower95", "upper95", "standard_error", "verdict", "explained", "moves"))


@cache
def finished_runs(name: str) -> tuple[Plan, pl.DataFrame]:
    """Return a plan and the results of all its runs."""
    plan = Plan.load(name)
    return plan, results(plan, 1.0, lambda _: {"evaluations": 600, **SEARCHED})


def stores(errors: dict[str, float]) -> dict[str, Store]:
    """Return finished studies whose methods have these mean errors [%] for single faults."""
    lost = pl.when((pl.col("case") == "multiple") & (pl.col("method") != "hybrid")).then(30.0).otherwise(1.0)
    error = lost * pl.col("method").replace_strict(errors, default=1.5)
    by_name = {}
    for name in PLANS:
        plan, runs = finished_runs(name)
        by_name[name] = Store(
            Path("studies") / name, plan, runs.with_columns(error.alias("error_percent")), (), 300.0
        )
    return by_name


@pytest.fixture
def undrawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder for the page; report and scans, which have their own tests, are left out."""
    rows = [
        {"model": "monitor", "equivalent": "magnitude", "fitness": "thesis", "bias_points": -12.0},
        {"model": "averaged", "equivalent": "torque", "fitness": "least_squares", "bias_points": 0.25},
    ]
    monkeypatch.setattr(comparison_page, "fitness_study", lambda _: pl.DataFrame(rows))
    monkeypatch.setattr(comparison_page, "fitness_table", lambda _: "| scans |")
    monkeypatch.setattr(comparison_page, "draw_scans", lambda _: None)
    monkeypatch.setattr(comparison_page, "svg", lambda _: b"<svg/>")
    monkeypatch.setattr(comparison_page, "write_study_report", lambda *_: None)
    (tmp_path / "comparison" / "figures").mkdir(parents=True)
    return tmp_path / "comparison"


def test_the_page_has_the_numbers_of_the_studies(undrawn: Path) -> None:
    write_comparison(stores(ERRORS), undrawn)
    page = undrawn.with_suffix(".md").read_text(encoding="utf-8")
    assert "the 1100 runs here took\n5.0 minutes" in page
    for method, error in ERRORS.items():
        assert f"| {method} | {error:.2f} |" in page
    assert "(comparison/figures/scans.svg)" in page
    assert "{{" not in page
    assert page.startswith("# The thesis's comparison of methods, redone\n\nMade by")


def test_the_page_states_that_its_studies_are_of_several_versions(undrawn: Path) -> None:
    studies = stores(ERRORS)
    mixed = studies["forms"].results.with_columns(revision=pl.lit("ba9876543210"))
    write_comparison(studies | {"forms": replace(studies["forms"], results=mixed)}, undrawn)
    page = undrawn.with_suffix(".md").read_text(encoding="utf-8")
    _, _, warning, *_ = page.splitlines()
    assert warning.startswith(
        "> **Results of 2 versions of the models are mixed: 0123456789ab, ba9876543210."
    )


@pytest.mark.parametrize(
    ("changed", "finding"),
    [
        ({"DE": 1.5}, "DE is at or below its printed mean"),
        ({"GWO": 1.0}, "GWO stays above its printed mean"),
        ({"hybrid": 1.45}, "hybrid beats the best printed mean"),
    ],
)
def test_a_finding_that_no_longer_holds_raises_an_error(
    undrawn: Path, changed: dict[str, float], finding: str
) -> None:
    with pytest.raises(StudyError, match=f"no longer true, rewrite report/comparison.md.jinja: {finding}"):
        write_comparison(stores(ERRORS | changed), undrawn)
    assert not undrawn.with_suffix(".md").exists()


def test_an_unfinished_study_is_refused(tmp_path: Path) -> None:
    for name in PLANS:
        Store.create(tmp_path / name, Plan.load(name))
    with pytest.raises(
        StudyError, match=r"thesis: 0 of 1100 runs; finish it with: emaphm study run thesis -o"
    ):
        finished(tmp_path)
