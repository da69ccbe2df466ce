"""Statistics of a study, compared with plain numpy and scipy, closed forms and a manual example."""

from itertools import combinations

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from emaphm.study.analysis.convergence import convergence
from emaphm.study.analysis.ranks import FEWEST_BLOCKS, friedman, holm, mean_ranks, pairs
from emaphm.study.analysis.statistics import (
    VARIANT,
    across_variants,
    bootstrap_interval,
    by_case,
    by_method,
    reliability,
)
from emaphm.study.thesis import published

from .conftest import CASES, METHODS, study

SINGLE = [case for case in CASES if case != "multiple"]


def _errors(runs: pl.DataFrame, **where: str) -> np.ndarray:
    """Return the errors of the matching rows, without polars expressions."""
    chosen = [
        row["error_percent"]
        for row in runs.iter_rows(named=True)
        if all(row[name] == value for name, value in where.items())
    ]
    return np.array(chosen)


def _with_errors(errors: dict[str, list[float]]) -> pl.DataFrame:
    """Return a study of one case in which the runs of each method have the given errors [%]."""
    count = len(next(iter(errors.values())))
    runs = study(tuple(errors), ("low F",), count)
    values = [errors[row["method"]][row["run"]] for row in runs.iter_rows(named=True)]
    return runs.with_columns(pl.Series("error_percent", values))


def _one(table: pl.DataFrame, **where: str) -> dict[str, float]:
    """Return the only matching row."""
    rows = [
        row for row in table.iter_rows(named=True) if all(row[name] == value for name, value in where.items())
    ]
    assert len(rows) == 1
    return rows[0]


@pytest.mark.parametrize(("case", "method"), [("low F", "GA"), ("multiple", "hybrid")])
def test_the_description_of_each_case_and_method_agrees_with_numpy(
    runs: pl.DataFrame, case: str, method: str
) -> None:
    row = _one(by_case(runs), case=case, method=method)
    errors = _errors(runs, case=case, method=method)
    assert row["runs"] == errors.size == 10
    quartiles = np.percentile(errors, [25, 50, 75])
    # Only rounding may differ: sums of ten numbers in another order.
    assert [row[name] for name in ("lower_quartile", "median", "upper_quartile")] == pytest.approx(quartiles)
    assert row["mean"] == pytest.approx(np.mean(errors))
    assert row["worst"] == np.max(errors)
    assert row["deviation"] == pytest.approx(np.std(errors, ddof=1))
    for limit in (1, 2, 5):
        assert row[f"within_{limit}"] == sum(error <= limit for error in errors) / 10
    chosen = runs.filter(pl.col("case") == case, pl.col("method") == method)
    assert row["seconds"] == pytest.approx(np.median(chosen["seconds"].to_numpy()))
    assert row["evaluations"] == pytest.approx(np.mean(chosen["evaluations"].to_numpy()))
    assert row["reference_runs"] == (4 if method == "hybrid" else 0)


def test_the_average_is_the_mean_of_the_cases_means_over_single_faults(runs: pl.DataFrame) -> None:
    # One case has more runs than other cases: the plain mean of all runs differs.
    uneven = runs.filter((pl.col("case") != "low F") | (pl.col("run") < 2))
    row = _one(by_method(uneven), method="DA", kind="single faults")
    means = [np.mean(_errors(uneven, case=case, method="DA")) for case in SINGLE]
    assert row["cases"] == 10
    assert row["runs"] == 92
    assert row["mean"] == pytest.approx(np.mean(means))
    pooled = np.concatenate([_errors(uneven, case=case, method="DA") for case in SINGLE])
    assert row["median"] == pytest.approx(np.median(pooled))
    assert row["mean"] != pytest.approx(np.mean(pooled), rel=1e-6)


def test_the_mean_of_the_thesis_is_over_the_same_cases(runs: pl.DataFrame) -> None:
    few = runs.filter(pl.col("case").is_in(["low F", "high Na", "multiple"]))
    table = by_method(few)
    printed = (published.MEAN_ERROR["low F"]["GA"] + published.MEAN_ERROR["high Na"]["GA"]) / 2
    assert _one(table, method="GA", kind="single faults")["thesis"] == pytest.approx(printed)
    assert _one(table, method="hybrid", kind="single faults")["thesis"] is None
    seconds = (published.MEAN_SECONDS["low F"]["GA"] + published.MEAN_SECONDS["high Na"]["GA"]) / 2
    assert _one(table, method="GA", kind="single faults")["thesis_seconds"] == pytest.approx(seconds)


def test_averages_over_the_ten_cases_of_the_thesis_are_the_printed_averages(runs: pl.DataFrame) -> None:
    table = by_method(runs)
    for method in published.METHODS:
        row = _one(table, method=method, kind="single faults")
        assert (row["thesis"], row["thesis_seconds"]) == (published.ERROR[method], published.SECONDS[method])
    assert _one(table, method="DA", kind="several faults")["thesis"] == published.MEAN_ERROR["multiple"]["DA"]


def test_a_case_of_the_thesis_is_recognised_by_its_faults_and_not_by_its_name() -> None:
    runs = study(("GA",), ("low F", "high F"), 2)
    swapped = runs.with_columns(pl.col("case").replace({"low F": "high F", "high F": "my own"}))
    table = by_case(swapped)
    for case, called in (("low F", "high F"), ("high F", "my own")):
        assert _one(table, case=called)["thesis"] == published.MEAN_ERROR[case]["GA"]
    relabelled = swapped.with_columns(pl.lit([0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.5, 0.5]).alias("truth"))
    assert by_case(relabelled)["thesis"].to_list() == [None, None]


def test_a_case_missing_for_one_method_is_left_out_of_all_averages(runs: pl.DataFrame) -> None:
    lacking = runs.filter((pl.col("case") != "high K") | (pl.col("method") != "PSO"))
    complete, part = by_method(lacking), by_method(runs.filter(pl.col("case") != "high K"))
    assert complete.equals(part)
    assert by_case(lacking).height == by_case(runs).height - 1


def test_a_run_missing_for_one_method_is_left_out_of_all_figures() -> None:
    errors = {"GA": [1.0, 2.0, 3.0], "hybrid": [4.0, 5.0, 6.0]}
    lacking = _with_errors(errors).filter((pl.col("method") != "GA") | (pl.col("run") < 2))
    table = by_method(lacking)
    for method, (low, high) in {"GA": (1.0, 2.0), "hybrid": (4.0, 5.0)}.items():
        row = _one(table, method=method)
        assert (row["runs"], row["worst"], row["median"]) == (2, high, (low + high) / 2)
    assert by_case(lacking)["runs"].to_list() == [2, 3]


def test_runs_of_another_seed_are_not_compared() -> None:
    runs = study(("GA", "hybrid"), ("low F", "low B"), 2)
    row_condition = (pl.col("case") == "low B") & (pl.col("method") == "GA") & (pl.col("run") == 1)
    apart = runs.with_columns(pl.when(row_condition).then(7).otherwise("seed").alias("seed"))
    assert by_method(apart)["runs"].to_list() == [3, 3]


def test_only_runs_common_to_all_variants_count(variants: pl.DataFrame) -> None:
    lacking = variants.filter(~((pl.col("noise_A") == 0.1) & (pl.col("run") == 3)))
    assert across_variants(lacking).equals(across_variants(variants.filter(pl.col("run") != 3)))


def test_a_study_without_common_cases_has_no_averages(runs: pl.DataFrame) -> None:
    apart = runs.filter((pl.col("case") == "low F") == (pl.col("method") == "GA"))
    assert by_method(apart).is_empty()
    assert reliability(apart).is_empty()
    assert across_variants(apart).is_empty()
    assert friedman(apart)["p"].to_list() == [None]
    assert mean_ranks(apart)["mean_rank"].null_count() == len(METHODS)


def test_an_empty_table_has_empty_statistics(runs: pl.DataFrame) -> None:
    first_runs = runs.head(2 * len(METHODS))
    for function in (by_case, by_method, reliability, friedman, mean_ranks, pairs, across_variants):
        assert function(runs.head(0)).is_empty()
        assert function(runs.head(0)).columns == function(first_runs).columns


def test_a_single_run_has_no_spread_and_no_interval() -> None:
    row = by_method(study(("GA",), ("low F",), 1)).row(0, named=True)
    assert row["mean"] == row["median"] == row["worst"]
    assert row["lower95"] is None
    assert row["upper95"] is None
    assert by_case(study(("GA",), ("low F",), 1))["deviation"].to_list() == [None]


def test_the_bootstrap_interval_of_many_runs_is_that_of_the_normal_distribution() -> None:
    rng = np.random.default_rng(3)
    cases = [rng.normal(mean, 1.0, 400) for mean in (5.0, 50.0)]
    interval = bootstrap_interval(cases)
    assert interval is not None
    # The cases differ by 45, which must not widen it: half width 1.96 sd of the mean of two means of 400.
    spread = np.sqrt(sum(np.var(case) / case.size for case in cases)) / 2
    # A percentile of 2000 resamples: 1.96 is uncertain by 0.06 (its standard error); three of these.
    centre, half = np.mean(interval), (interval[1] - interval[0]) / 2
    assert half / spread == pytest.approx(1.96, abs=0.18 / np.sqrt(2))
    assert centre == pytest.approx(np.mean([case.mean() for case in cases]), abs=0.18 * spread)
    assert bootstrap_interval(cases) == interval


def test_reliability_follows_the_formula_of_the_thesis(runs: pl.DataFrame) -> None:
    products = {}
    for method in METHODS:
        chosen = runs.filter(pl.col("method") == method, pl.col("case") != "multiple")
        # Each case has ten runs, so that plain means equal means of means.
        products[method] = np.mean(chosen["seconds"].to_numpy()) * np.mean(chosen["error_percent"].to_numpy())
    table = reliability(runs)
    five = sum(products[method] for method in published.METHODS)
    for method in METHODS:
        row = _one(table, method=method)
        assert row["all_methods"] == pytest.approx(100 - 100 * products[method] / sum(products.values()))
        in_thesis = method in published.METHODS
        expected = 100 - 100 * products[method] / five if in_thesis else None
        assert row["thesis_methods"] == (pytest.approx(expected) if in_thesis else None)
        assert row["thesis_printed"] == published.RELIABILITY_PRINTED.get(method)
        assert row["thesis_recomputed"] == published.reliability().get(method)
    assert table["all_methods"].sum() == pytest.approx(100 * (len(METHODS) - 1))  # sum of 1 - share


def test_reliability_is_undefined_for_one_method_or_without_errors() -> None:
    assert reliability(study(("GA",)))["all_methods"].to_list() == [None]
    perfect = _with_errors({"GA": [0.0, 0.0], "hybrid": [0.0, 0.0]})
    assert reliability(perfect)["all_methods"].to_list() == [None, None]


def test_friedman_and_mean_ranks_agree_with_scipy(runs: pl.DataFrame) -> None:
    columns = [_errors(runs, method=method) for method in METHODS]
    expected = stats.friedmanchisquare(*columns)
    test = friedman(runs).row(0, named=True)
    assert (test["methods"], test["blocks"], test["incomplete"]) == (9, 110, 0)
    assert test["statistic"] == pytest.approx(expected.statistic)
    assert test["p"] == pytest.approx(expected.pvalue)
    ranks = mean_ranks(runs)
    # Friedman's statistic from the mean ranks (no ties): 12 n / (k (k + 1)) sum (R - (k + 1) / 2)².
    k, n = 9, 110
    statistic = 12 * n / (k * (k + 1)) * np.sum((ranks["mean_rank"].to_numpy() - (k + 1) / 2) ** 2)
    assert test["statistic"] == pytest.approx(statistic)


def test_the_order_of_the_rows_has_no_effect(runs: pl.DataFrame) -> None:
    shuffled = runs.sample(fraction=1, shuffle=True, seed=5)
    for function in (by_case, by_method, reliability, friedman, mean_ranks, pairs):
        assert function(shuffled).equals(function(runs))


def test_incomplete_blocks_are_counted_and_left_out(runs: pl.DataFrame) -> None:
    lacking = runs.filter(~((pl.col("method") == "DE") & (pl.col("run") == 3)))
    test = friedman(lacking).row(0, named=True)
    assert (test["blocks"], test["incomplete"]) == (99, 11)
    without = friedman(runs.filter(pl.col("run") != 3)).row(0, named=True)
    assert test["statistic"] == without["statistic"]
    pair = _one(pairs(lacking), method="GA", other="PSO")
    assert pair["blocks"] == 110  # these two methods have all their runs
    assert _one(pairs(lacking), method="GA", other="DE")["blocks"] == 99


def test_a_dominated_method_ranks_last_and_differs_significantly() -> None:
    rng = np.random.default_rng(0)
    good = rng.uniform(1, 2, (2, 20))
    bad = good.max(axis=0) + rng.uniform(1, 2, 20)  # no two differences are equal: the test is exact
    runs = _with_errors({"GA": [*good[0]], "bad": [*bad], "DE": [*good[1]]})
    ranks = {row["method"]: row["mean_rank"] for row in mean_ranks(runs).iter_rows(named=True)}
    assert ranks["bad"] == 3.0
    assert friedman(runs)["p"][0] < 0.001
    for row in pairs(runs).iter_rows(named=True):
        if "bad" in (row["method"], row["other"]):
            # All 20 differences have one sign: 2/2^20, at most tripled.
            assert row["p"] == pytest.approx(2 / 2**20)
            assert row["p_holm"] <= 3 * 2 / 2**20
            assert {row["lower"], row["higher"]} == {0, 20}
        else:
            assert row["p_holm"] > 0.05


def test_identical_methods_do_not_differ() -> None:
    errors = [1.0, 2.0, 0.0, 4.0, 5.0, 6.0, 7.0]
    runs = _with_errors({"GA": errors, "PSO": errors, "DE": errors})
    assert friedman(runs).row(0, named=True)["p"] == 1.0
    assert mean_ranks(runs)["mean_rank"].to_list() == [2.0, 2.0, 2.0]
    tests = pairs(runs)
    assert tests["p"].to_list() == tests["p_holm"].to_list() == [1.0, 1.0, 1.0]


def test_tied_errors_share_their_ranks() -> None:
    runs = _with_errors({"GA": [1.0] * 6, "PSO": [1.0] * 6, "DE": [2.0] * 6})
    assert mean_ranks(runs)["mean_rank"].to_list() == [1.5, 1.5, 3.0]
    test = friedman(runs).row(0, named=True)
    # By hand: 12 n/(k (k+1)) sum (R - 2)² = 6 × 1.5 = 9, over 1 - (t³ - t)/(k³ - k) = 1 - 6/24: 12.
    assert test["statistic"] == pytest.approx(12.0)
    assert test["p"] == pytest.approx(np.exp(-6.0))  # the chi-square's tail with two degrees of freedom


def test_equal_errors_are_left_out_of_the_test_of_a_pair() -> None:
    runs = _with_errors({"GA": [1.0] * 8, "DE": [1.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]})
    row = pairs(runs).row(0, named=True)
    assert (row["blocks"], row["lower"], row["higher"]) == (8, 6, 0)
    assert row["median_difference"] == pytest.approx(-2.5)
    assert row["p"] == pytest.approx(2 / 2**6)  # six differences of one sign


@pytest.mark.parametrize(("blocks", "tested"), [(FEWEST_BLOCKS - 1, False), (FEWEST_BLOCKS, True)])
def test_too_few_blocks_have_no_test(blocks: int, *, tested: bool) -> None:
    runs = study(("GA", "DE", "hybrid"), ("low F",), blocks)
    assert (friedman(runs)["p"][0] is not None) is tested
    tests = pairs(runs)
    assert tests["p"].null_count() == tests["p_holm"].null_count() == (0 if tested else 3)
    assert mean_ranks(runs)["mean_rank"].null_count() == 0  # a description, not a test


def test_two_methods_have_a_test_of_the_pair_and_no_friedman_test() -> None:
    runs = study(("GA", "DE"))
    assert friedman(runs)["p"].to_list() == [None]
    row = pairs(runs).row(0, named=True)
    expected = stats.wilcoxon(_errors(runs, method="GA"), _errors(runs, method="DE"))
    assert row["p"] == row["p_holm"] == pytest.approx(expected.pvalue)


def test_holms_correction_agrees_with_a_manual_example() -> None:
    # Sorted 0.01, 0.02, 0.03, 0.04 times 4, 3, 2, 1: 0.04, 0.06, 0.06, 0.04, the last not below the third.
    assert holm([0.04, 0.01, 0.03, 0.02]) == pytest.approx([0.06, 0.04, 0.06, 0.06])
    assert holm([0.5, 0.9]) == pytest.approx([1.0, 1.0])
    assert holm([]).size == 0


@given(st.lists(st.floats(0, 1), min_size=1, max_size=6))
def test_holms_correction_agrees_with_its_sequential_procedure(p_values: list[float]) -> None:
    level, rejected = 0.05, set()
    for step, i in enumerate(np.argsort(p_values, kind="stable")):
        if p_values[i] * (len(p_values) - step) > level:
            break
        rejected.add(int(i))
    assert {i for i, p in enumerate(holm(p_values)) if p <= level} == rejected


def test_pairs_of_all_methods_are_corrected_together(runs: pl.DataFrame) -> None:
    tests = pairs(runs)
    assert list(zip(tests["method"], tests["other"], strict=True)) == list(combinations(METHODS, 2))
    np.testing.assert_array_equal(tests["p_holm"], holm(tests["p"].to_numpy()))


def test_variants_are_evaluated_separately(variants: pl.DataFrame) -> None:
    quiet = variants.filter(pl.col("noise_A") == 0)
    for function in (by_case, by_method, reliability, friedman, mean_ranks, pairs):
        joint = function(variants)
        assert joint.filter(pl.col("noise_A") == 0).equals(function(quiet))
        assert joint.select(VARIANT).unique().height == 2


def test_only_cases_common_to_all_variants_count(variants: pl.DataFrame) -> None:
    lacking = variants.filter(
        ~((pl.col("noise_A") == 0.1) & (pl.col("case") == "high F") & (pl.col("method") == "DE"))
    )
    table = across_variants(lacking)
    row = table.row(
        by_predicate=(pl.col("kind") == "single faults")
        & (pl.col("method") == "GA")
        & (pl.col("noise_A") == 0)
    )
    expected = np.mean(_errors(variants.filter(pl.col("noise_A") == 0), case="low F", method="GA"))
    assert row[-2:] == (1, pytest.approx(expected))
    assert table.height == 2 * 2 * 3


def test_a_direction_is_no_fault_and_healthy_is_a_separate_kind() -> None:
    runs = study(("GA",), ("low F",), 2)
    healthy = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.9, 0.5]
    turned = runs.with_columns(pl.Series("truth", [healthy] * 2))
    assert by_case(turned)["kind"].to_list() == ["no faults"]


def test_convergence_keeps_the_last_value_and_uses_the_median_run() -> None:
    runs = study(("GA",), ("low F",), 3).with_columns(
        pl.Series("curve_evaluations", [[10, 20, 40], [10, 20, 40], [10, 20]]),
        pl.Series("curve_error_percent", [[9.0, 6.0, 1.0], [8.0, 5.0, 2.0], [7.0, 4.0]]),
    )
    evaluations, quartiles = convergence(runs, "curve_error_percent")["GA"]
    assert (evaluations[0], evaluations[-1]) == (10, 40)
    median = dict(zip(evaluations, quartiles[1], strict=True))
    assert median[10] == 8.0
    assert median[40] == 2.0  # of 1, 2 and the 4 that the third run ended with
    assert {value for at, value in median.items() if 20 < at < 40} == {5.0}
    assert quartiles[0][0] == 7.5  # midway between the best two of three


def test_methods_without_populations_have_no_curve(runs: pl.DataFrame) -> None:
    curves = convergence(runs, "curve_fitness")
    assert set(curves) == set(METHODS) - {"hybrid", "hybrid uncorrected"}
