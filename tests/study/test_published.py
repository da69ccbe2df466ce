"""Consistency of the thesis's printed figures, by arithmetic on its own tables."""

from typing import Any

import numpy as np
import polars as pl
import pytest

from emaphm.actuator import Faults
from emaphm.errors import StudyError
from emaphm.study.plan import Plan
from emaphm.study.thesis import published

SINGLE = [case for case in published.CASES if case != "multiple"]

MEANS = published.dragonfly_means()


def test_the_cases_are_those_of_the_built_in_plan() -> None:
    planned = {name: Faults.from_mapping(faults) for name, faults in Plan.load("thesis").cases.items()}
    assert planned == {name: Faults.from_mapping(faults) for name, faults in published.CASES.items()}


@pytest.mark.parametrize("method", published.METHODS)
def test_errors_average_to_the_printed_average(method: str) -> None:
    mean = np.mean([published.MEAN_ERROR[case][method] for case in SINGLE])
    if method == "GA":
        assert mean == pytest.approx(
            2.608
        )  # printed as 2.57, which is not the average of the printed figures
    else:
        # Half a unit of the second decimal in the average and in the averaged figures.
        assert mean == pytest.approx(published.ERROR[method], abs=0.01)


@pytest.mark.parametrize("method", published.METHODS)
def test_times_average_to_the_printed_average(method: str) -> None:
    times = {case: published.MEAN_SECONDS[case][method] for case in SINGLE}
    if method == "DA":
        times["low K"] *= 2  # printed as run, whereas the other nine are doubled
    # Half a second of rounding in the average and in the averaged figures.
    assert np.mean(list(times.values())) == pytest.approx(published.SECONDS[method], abs=1.0)


@pytest.mark.parametrize("case", [case for case in SINGLE if case != "low K"])
def test_compared_dragonfly_times_are_twice_its_own(case: str) -> None:
    twice = 2 * published.DRAGONFLY_SECONDS[case]
    # Doubled before rounding, the mean may deviate by a second; that of high G deviates by four, unexplained.
    assert published.MEAN_SECONDS[case]["DA"] == pytest.approx(twice, abs=4 if case == "high G" else 2)


def test_all_110_runs_are_present() -> None:
    rows = published.dragonfly_rows()
    assert rows["case"].to_list() == [case for case in published.CASES for _ in range(10)]
    assert rows["run"].to_list() == [*range(1, 11)] * len(published.CASES)
    assert sum(rows.null_count().row(0)) == 0
    components = rows.select(published.COMPONENTS).to_numpy()
    assert (components.min(), components.max()) == (0, 1)


ODD_ERRORS = {
    "high B": (13.831, 14.0),
    "low Na": (12.883, 12.83),
    "high K": (17.152, 19.23),
    "multiple": (64.345, 64.2),
}
"""Mean of the rows and printed mean, where rounding cannot cause the difference."""

ODD_SECONDS = {"high B": (1028.3, 1027), "low Na": (1043.5, 953)}


@pytest.mark.parametrize("row", list(MEANS.iter_rows(named=True)), ids=MEANS["case"].to_list())
def test_errors_of_the_rows_average_to_the_printed_values(row: dict[str, Any]) -> None:
    printed = published._text_rows().filter(pl.col("case") == row["case"])["error_printed"]
    half_units = [0.5 / 10 ** len(text.partition(".")[2]) for text in printed]
    last = 0.05 if row["case"] == "multiple" else 0.005  # printed with one decimal, with two
    tolerance = float(np.mean(half_units)) + last
    difference = abs(row["error_of_rows"] - row["error_printed"])
    if row["case"] in ODD_ERRORS:
        assert difference > tolerance
        assert (row["error_of_rows"], row["error_printed"]) == pytest.approx(ODD_ERRORS[row["case"]])
    else:
        assert difference <= tolerance


@pytest.mark.parametrize("row", list(MEANS.iter_rows(named=True)), ids=MEANS["case"].to_list())
def test_times_of_the_rows_average_to_the_printed_values(row: dict[str, Any]) -> None:
    means = row["seconds_of_rows"], row["seconds_printed"]
    # The averages are whole seconds, some rounded and some cut off.
    if row["case"] in ODD_SECONDS:
        assert abs(means[0] - means[1]) > 1
        assert means == pytest.approx(ODD_SECONDS[row["case"]])
    else:
        assert means[0] == pytest.approx(means[1], abs=1.0)


def test_errors_of_low_friction_follow_from_the_faults() -> None:
    """Without eccentricity, phase and shorts, the error is only that of friction, backlash and gain."""
    rows = published.recomputed_rows().filter(pl.col("case") == "low F")
    by_hand = 100 * np.sqrt(
        (rows["k1"].to_numpy() - 0.25) ** 2 + rows["k2"].to_numpy() ** 2 + (rows["k8"].to_numpy() - 0.5) ** 2
    )
    for formula in published.FORMULAS:
        np.testing.assert_allclose(rows[formula], by_hand, rtol=1e-12)  # equal to rounding of doubles
    # Run 4 found 0.2489 and 0.4950, 0.512 %; run 9 0.2480 and 0.4908, 0.941 %, with rounding 0.936 %.
    odd = rows.filter(~pl.col("explained"))
    assert odd.select("run", "error_printed").rows() == [(4, 0.88), (9, 0.92)]
    assert by_hand[[3, 8]] == pytest.approx([0.512, 0.941], abs=5e-4)


def _row(frame: pl.DataFrame, case: str, run: int) -> dict[str, Any]:
    return frame.filter(pl.col("case") == case, pl.col("run") == run).row(0, named=True)


def test_low_eccentricity_run_8_contradicts_itself() -> None:
    """It found k6 = 0.2544, k7 = 0.4988, k8 = 0.5031, and is printed with 3.35 %."""
    row = _row(published.contradicting_rows(), "low K", 8)
    assert row["error_printed"] == 3.35
    assert row["error"] == pytest.approx(100 * np.sqrt(0.0044**2 + 0.25 * 0.0012**2 + 0.0031**2))
    assert row["error_true_weight"] == pytest.approx(100 * np.sqrt(0.25 * 0.0012 + 0.0031**2))
    assert row["error_found_weight"] == pytest.approx(100 * np.sqrt(0.2544 * 0.0012 + 0.0031**2))


def test_a_phase_beyond_the_true_phase_has_no_real_error_by_the_printed_formula() -> None:
    """High K, run 6: 0.7606 (0.5 - 0.5012) + 0.0022² < 0."""
    row = _row(published.contradicting_rows(), "high K", 6)
    assert row["error_found_weight"] is None
    assert row["error_true_weight"] is None


@pytest.mark.parametrize(
    ("case", "run", "formula", "value"),
    [("high K", 10, "error_found_weight", 16.42), ("high B", 10, "error_true_weight", 11.16)],
)
def test_some_errors_follow_only_from_the_printed_formula(
    case: str, run: int, formula: str, value: float
) -> None:
    row = _row(published.recomputed_rows().filter("explained"), case, run)
    # Half a unit of the printed decimals, and of the fourth decimal of components: 0.014 % at most.
    assert row[formula] == pytest.approx(value, abs=0.005 + 0.014)
    assert abs(row["error"] - value) > 1


def test_no_multiple_fault_row_follows_from_the_faults() -> None:
    rows = published.contradicting_rows().filter(pl.col("case") == "multiple")
    assert rows["run"].to_list() == [*range(1, 11)]


def test_most_gain_errors_follow_from_the_faults() -> None:
    """Exceptions are two runs of high G: 0.7337 without other faults is 1.63 %, and 0.7344 is 1.56 %."""
    rows = published.contradicting_rows().filter(pl.col("case").is_in(["low G", "high G"]))
    odd = rows.select("case", "run", "error_printed").rows()
    assert odd == [("high G", 3, 1.56), ("high G", 9, 1.58)]
    assert rows["error"].to_list() == pytest.approx([1.63, 1.56])


def test_the_dragonfly_ranks_last_with_the_recomputed_errors() -> None:
    """Despite inconsistent rows, the thesis's ranking holds for the errors of the estimated faults."""
    mean = MEANS.filter(pl.col("case") != "multiple")["error"].to_numpy().mean()
    assert mean > 3 * max(published.ERROR[method] for method in published.METHODS if method != "DA")


def test_reliability_follows_from_the_printed_times_and_errors() -> None:
    """The row in docs/physics.md, section 8, in whole percent."""
    percent = {method: round(value) for method, value in published.reliability().items()}
    assert percent == {"GA": 81, "PSO": 90, "DE": 93, "GWO": 91, "DA": 44}


def test_the_printed_reliability_cannot_follow_from_any_times_and_errors() -> None:
    """The shares t_i err_i / sum add up to 1, so the coefficients of five methods do to 400 %."""
    assert sum(published.reliability().values()) == pytest.approx(400)
    # Five figures in whole percent deviate by at most 2.5.
    assert abs(sum(published.RELIABILITY_PRINTED.values()) - 400) > 2.5


def test_reliability_needs_both_figures_of_each_method() -> None:
    with pytest.raises(StudyError, match=r"^DE: only a time or only an error is given; give both"):
        published.reliability({"GA": 1.0, "DE": 2.0}, {"GA": 1.0})


def test_printed_healthy_fitnesses_differ_although_the_faults_are_the_same() -> None:
    healthy = [state.value for state in published.FITNESS if state.faults == Faults()]
    assert len(healthy) == 5
    assert max(healthy) > 12 * min(healthy)


def test_the_fitness_of_equal_faults_is_printed_with_two_values() -> None:
    """The low eccentricity and the nominal phase are the same faults; 2.7e-4 and 2.6e-4 are printed."""
    values = [state.value for state in published.FITNESS if state.faults == Faults(eccentricity=0.25)]
    assert values == [2.7e-4, 2.6e-4]
