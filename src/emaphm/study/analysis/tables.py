"""Text tables of a study: errors and times in the layout of the thesis, success, ranks, variants."""

from collections.abc import Callable, Mapping
from typing import Any

import polars as pl

from emaphm.study.analysis.ranks import mean_ranks, pairs
from emaphm.study.analysis.statistics import (
    LIMITS_PERCENT,
    VARIANT,
    across_variants,
    by_case,
    by_method,
    reliability,
)
from emaphm.text_table import NOTHING, TextTable

MOST_CASES = 24
"""Largest number of cases that a page lists and draws individually; a study may have hundreds."""

TOO_FEW = "too few"
"""Text in place of a p-value if there are too few runs for a test."""


def summary_table(runs: pl.DataFrame, kind: str) -> TextTable:
    """Return error, success and cost of each method over the cases of one `kind`, least mean error first."""
    methods = by_method(runs).filter(pl.col("kind") == kind).sort("mean", maintain_order=True)
    header = (
        "method",
        "mean error, %",
        "95 % interval",
        "median, %",
        "worst, %",
        "within 2 %, % of runs",
        "evaluations",
        "reference runs",
        "median time of a run, s",
        "runs",
    )
    rows = [
        (
            row["method"],
            percent(row["mean"]),
            NOTHING if row["lower95"] is None else f"{percent(row['lower95'])} to {percent(row['upper95'])}",
            percent(row["median"]),
            percent(row["worst"]),
            f"{100 * row['within_2']:.0f}",
            f"{row['evaluations']:.0f}",
            f"{row['reference_runs']:.3g}",
            seconds(row["seconds"]),
            str(row["runs"]),
        )
        for row in methods.iter_rows(named=True)
    ]
    return TextTable(header, tuple(rows))


def error_table(runs: pl.DataFrame) -> TextTable:
    """Return the mean errors [%] of one variant in the layout of the thesis: this study / thesis."""
    return _by_case_and_method(runs, lambda row: _with_thesis(percent, row["mean"], row["thesis"]))


def time_table(runs: pl.DataFrame) -> TextTable:
    """Return the mean wall times [s] of one variant in the layout of the thesis: this study / thesis."""
    return _by_case_and_method(
        runs, lambda row: _with_thesis(seconds, row["mean_seconds"], row["thesis_seconds"])
    )


def _by_case_and_method(runs: pl.DataFrame, cell: Callable[[Mapping[str, Any]], str]) -> TextTable:
    """Return a table with a row per case and per average of several cases, and a column per method."""
    methods = methods_of(runs)
    cells: dict[str, dict[str, str]] = {}
    for row in by_case(runs).iter_rows(named=True):
        cells.setdefault(row["case"], {})[row["method"]] = cell(row)
    averages: dict[str, dict[str, str]] = {}
    for row in by_method(runs).filter(pl.col("cases") > 1).iter_rows(named=True):
        name = f"Average of {row['cases']} cases, {row['kind']}"
        averages.setdefault(name, {})[row["method"]] = cell(row)
    listed = [*list(cells.items())[:MOST_CASES], *averages.items()]
    rows = tuple((name, *(row.get(method, NOTHING) for method in methods)) for name, row in listed)
    return TextTable(("case", *methods), rows)


def success_table(runs: pl.DataFrame) -> TextTable:
    """Return the share of runs [%] within each limit of error, by method and kind of case."""
    methods = by_method(runs)
    kinds = methods["kind"].unique(maintain_order=True).to_list()
    shares: dict[str, dict[tuple[str, int], str]] = {}
    for row in methods.iter_rows(named=True):
        for limit in LIMITS_PERCENT:
            shares.setdefault(row["method"], {})[row["kind"], limit] = f"{100 * row[f'within_{limit}']:.0f}"
    columns = [(kind, limit) for kind in kinds for limit in LIMITS_PERCENT]
    header = ("method", *(f"{kind}: error ≤ {limit} %" for kind, limit in columns))
    return TextTable(
        header, tuple((method, *map(row.__getitem__, columns)) for method, row in shares.items())
    )


def rank_table(runs: pl.DataFrame) -> TextTable:
    """Return the mean ranks of one variant, best first."""
    ranks = mean_ranks(runs).sort("mean_rank", maintain_order=True, nulls_last=True)
    rows = [
        (row["method"], NOTHING if row["mean_rank"] is None else f"{row['mean_rank']:.2f}")
        for row in ranks.iter_rows(named=True)
    ]
    return TextTable(("method", "mean rank"), tuple(rows))


def pair_table(runs: pl.DataFrame) -> TextTable:
    """Return the corrected p-values of all pairs of methods of one variant, ordered by their ranks."""
    methods = [row[0] for row in rank_table(runs).rows]
    tests: dict[tuple[str, str], str] = {}
    for row in pairs(runs).iter_rows(named=True):
        text = p_value(row["p_holm"])
        tests[row["method"], row["other"]] = tests[row["other"], row["method"]] = text
    rows = [(method, *(tests.get((method, other), NOTHING) for other in methods)) for method in methods]
    return TextTable(("p-value", *methods), tuple(rows))


def reliability_table(runs: pl.DataFrame) -> TextTable:
    """Return the reliability coefficients [%] of one variant and of the thesis; no rows if there are none."""
    header = (
        "method",
        "RC among all methods, %",
        "RC among the thesis's methods, %",
        "thesis, recomputed, %",
        "thesis, printed, %",
    )
    figures = ("all_methods", "thesis_methods", "thesis_recomputed", "thesis_printed")
    rows = [
        (row["method"], *(NOTHING if row[name] is None else f"{row[name]:.1f}" for name in figures))
        for row in reliability(runs).drop_nulls("all_methods").iter_rows(named=True)
    ]
    return _without_empty_columns(TextTable(header, tuple(rows)))


def _without_empty_columns(table: TextTable) -> TextTable:
    columns = [i for i in range(len(table.header)) if any(row[i] != NOTHING for row in table.rows)]
    rows = tuple(tuple(row[i] for i in columns) for row in table.rows)
    return TextTable(tuple(table.header[i] for i in columns), rows)


def variant_table(runs: pl.DataFrame, kind: str) -> TextTable:
    """Return the mean errors [%] over the cases of one `kind`, by method and variant."""
    names = variant_names(runs)
    cells: dict[str, dict[str, str]] = {}
    for row in across_variants(runs).filter(pl.col("kind") == kind).iter_rows(named=True):
        variant = names[tuple(row[name] for name in VARIANT)]
        cells.setdefault(row["method"], {})[variant] = percent(row["mean"])
    rows = [(method, *(row.get(name, NOTHING) for name in names.values())) for method, row in cells.items()]
    return TextTable(("method", *names.values()), tuple(rows))


def variant_names(runs: pl.DataFrame) -> dict[tuple[Any, ...], str]:
    """Return the distinguishing properties of each variant in words; for a single variant, all of them."""
    variants = runs.sort("index").select(VARIANT).unique(maintain_order=True)
    words = {
        "rig": "{}",
        "model": "{} model",
        "fitness": "fitness {}",
        "equivalent": "equivalent current {}",
        "noise_A": "{:g} A noise",
    }
    differing = [
        name
        for name in VARIANT
        if variants[name].n_unique() > 1 or (variants.height == 1 and variants[name][0] != "")
    ]
    return {
        tuple(row[name] for name in VARIANT): ", ".join(words[name].format(row[name]) for name in differing)
        for row in variants.iter_rows(named=True)
    }


def methods_of(runs: pl.DataFrame) -> list[str]:
    """Return the methods in the order of the plan."""
    return runs.sort("index")["method"].unique(maintain_order=True).to_list()


def percent(value: float) -> str:
    """Return an error [%] as text, with two decimals as in the thesis."""
    return "<0.01" if 0 < value < 0.005 else f"{value:.2f}"


def seconds(value: float) -> str:
    """Return a time [s] as text."""
    return f"{value:.0f}" if value >= 100 else f"{value:.2f}" if value >= 0.1 else f"{value:.2g}"


def p_value(p: float | None) -> str:
    """Return a p-value as text; `TOO_FEW` for None."""
    if p is None:
        return TOO_FEW
    return "<0.001" if p < 0.001 else f"{p:.3f}"


def _with_thesis(text: Callable[[float], str], ours: float, thesis: float | None) -> str:
    return text(ours) if thesis is None else f"{text(ours)} / {text(thesis)}"
