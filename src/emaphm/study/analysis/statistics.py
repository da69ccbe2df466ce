"""What the finished runs of a study say: errors, success and cost of each method.

Each function takes the frame of runs (`emaphm.study.store.SCHEMA`) and returns another, one row a group. A
study need not be complete: what is missing is null, never a guess.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from emaphm.actuator.faults import HEALTHY, NAMES, Faults
from emaphm.study.thesis import published

VARIANT = ("rig", "model", "fitness", "equivalent", "noise_A")
"""Columns by which the variants of a study differ; methods are compared within one."""

BLOCK = ("case", "run", "seed")
"""What the methods that are compared have in common: a case, its number, and the seed of its recording."""

LIMITS_PERCENT = (1, 2, 5)
"""A run has succeeded where its error is at most so much; in columns `within_1` and so on."""

SINGLE, SEVERAL, NONE = "single faults", "several faults", "no faults"
"""Kinds of cases. The thesis's averages are over the single faults."""

RESAMPLES = 2000
"""Resamples of a bootstrap: fifty of them lie beyond each end of the 95 % interval."""

BOOTSTRAP_SEED = 0

THESIS_CASES = {tuple(Faults(**faults).vector.tolist()): case for case, faults in published.CASES.items()}
"""Names of the thesis's cases by their faults: in a study they may be called otherwise."""

THESIS_AVERAGED = [case for case, faults in published.CASES.items() if len(faults) == 1]
"""The cases of the thesis's printed averages."""


def prepared(runs: pl.DataFrame) -> pl.DataFrame:
    """Return the runs in the order of the plan, with the `kind` of each case and its name in the thesis."""
    truths = runs["truth"].to_list()
    return runs.with_columns(
        pl.Series("kind", [_kind(truth) for truth in truths], dtype=pl.String),
        pl.Series("thesis_case", [THESIS_CASES.get(tuple(truth)) for truth in truths], dtype=pl.String),
    ).sort("index")


def _kind(truth: Sequence[float]) -> str:
    healthy = zip(NAMES, truth, HEALTHY.vector, strict=True)
    # A direction is no fault of its own.
    faults = sum(value != nominal for name, value, nominal in healthy if name != "eccentricity_phase")
    return (NONE, SINGLE)[faults] if faults < 2 else SEVERAL


def by_case(runs: pl.DataFrame) -> pl.DataFrame:
    """Return one row for each variant, case and method.

    Columns: those of `VARIANT`, `kind`, `case`, `method`, the number of `runs`; of the error [%] its `mean`,
    `median`, `lower_quartile`, `upper_quartile`, `worst` and `deviation` (standard; null for one run);
    `within_1`, `within_2`, `within_5`, the fractions of runs with at most that error; the means
    `evaluations` and `reference_runs`; `seconds`, the median, and `mean_seconds`; `thesis_case`, what the
    thesis calls a case of these faults, and `thesis` and `thesis_seconds`, the means printed there.
    """
    grouped = prepared(runs).group_by(*VARIANT, "kind", "case", "method", maintain_order=True)
    table = grouped.agg(
        pl.col("thesis_case").first(),
        pl.len().cast(pl.Int64).alias("runs"),
        *_spread(),
        pl.col("error_percent").std().alias("deviation"),
        *((pl.col("error_percent") <= limit).mean().alias(f"within_{limit}") for limit in LIMITS_PERCENT),
        pl.col("evaluations").mean(),
        pl.col("reference_runs").mean(),
        pl.col("seconds").median(),
        pl.col("seconds").mean().alias("mean_seconds"),
    )
    pairs = list(zip(table["thesis_case"], table["method"], strict=True))
    return table.with_columns(
        pl.Series(name, [printed.get(case, {}).get(method) for case, method in pairs], dtype=pl.Float64)
        for name, printed in (("thesis", published.MEAN_ERROR), ("thesis_seconds", published.MEAN_SECONDS))
    )


def _spread() -> list[pl.Expr]:
    error = pl.col("error_percent")
    return [
        error.mean().alias("mean"),
        error.median().alias("median"),
        error.quantile(0.25, "linear").alias("lower_quartile"),
        error.quantile(0.75, "linear").alias("upper_quartile"),
        error.max().alias("worst"),
    ]


def comparable(runs: pl.DataFrame) -> pl.DataFrame:
    """Return the runs that every method of their variant has: of the same case, number and seed.

    A mean over other cases than the next method's would compare the cases and not the methods; so would the
    worst error of more runs.
    """
    methods = pl.col("method").n_unique()
    return runs.filter(methods.over(*VARIANT, *BLOCK) == methods.over(*VARIANT))


def by_method(runs: pl.DataFrame) -> pl.DataFrame:
    """Return one row for each variant, kind of case and method, over the `comparable` runs.

    Columns as in `by_case`, but: `cases` is the number of their cases; `mean`, the fractions, `evaluations`,
    `reference_runs` and `mean_seconds` are means of the cases' means (the thesis's average); the other
    figures are those of all runs together. `lower95` and `upper95` are the ends of the mean's bootstrap
    interval, null where a case has one run. `thesis` and `thesis_seconds` are its printed averages where
    these are the ten cases of those, else the means of its figures for the same cases, null where it lacks
    one.
    """
    rows = comparable(prepared(runs))
    groups = (*VARIANT, "kind", "method")
    together = rows.group_by(*groups, maintain_order=True).agg(
        pl.len().cast(pl.Int64).alias("runs"),
        *(spread for spread in _spread() if spread.meta.output_name() != "mean"),
        pl.col("seconds").median(),
    )
    averaged = ["mean", "evaluations", "reference_runs", "mean_seconds"]
    averaged += [f"within_{limit}" for limit in LIMITS_PERCENT]
    thesis = ("thesis", "thesis_seconds")
    means = (
        by_case(rows)
        .group_by(*groups, maintain_order=True)
        .agg(
            pl.len().cast(pl.Int64).alias("cases"),
            *(pl.col(name).mean() for name in averaged),
            *(
                pl.when(pl.col(name).null_count() == 0).then(pl.col(name).mean()).alias(name)
                for name in thesis
            ),
            (pl.len() == pl.col("thesis_case").is_in(THESIS_AVERAGED).sum()).alias("_all"),
        )
    )
    for name, printed in zip(thesis, (published.ERROR, published.SECONDS), strict=True):
        average = pl.col("method").replace_strict(printed, default=None, return_dtype=pl.Float64)
        means = means.with_columns(
            pl.when(pl.col("_all") & (pl.col("cases") == len(THESIS_AVERAGED)))
            .then(average)
            .otherwise(name)
            .alias(name)
        )
    intervals = pl.DataFrame(
        [
            {**dict(zip(groups, key, strict=True)), **_interval(group)}
            for key, group in rows.group_by(*groups, maintain_order=True)
        ],
        schema={**{name: rows.schema[name] for name in groups}, "lower95": pl.Float64, "upper95": pl.Float64},
    )
    joined = together.join(means.drop("_all"), on=groups, maintain_order="left")
    return joined.join(intervals, on=groups, maintain_order="left")


def _interval(runs: pl.DataFrame) -> dict[str, float | None]:
    cases = [group["error_percent"].to_numpy() for _, group in runs.group_by("case", maintain_order=True)]
    lower, upper = bootstrap_interval(cases) or (None, None)
    return {"lower95": lower, "upper95": upper}


def bootstrap_interval(cases: Sequence[NDArray[np.float64]]) -> tuple[float, float] | None:
    """Return the 95 % percentile interval of the mean of the means of `cases`, each of shape (runs,).

    Runs are drawn anew within each case: the cases are the study's, the luck is in the runs. None where a
    case has fewer than two runs, as its scatter is unknown then.
    """
    if not cases or min(case.size for case in cases) < 2:
        return None
    rng = np.random.default_rng(BOOTSTRAP_SEED)
    means = np.zeros(RESAMPLES)
    for case in cases:
        means += case[rng.integers(case.size, size=(RESAMPLES, case.size))].mean(axis=1)
    lower, upper = np.percentile(means / len(cases), [2.5, 97.5])
    return float(lower), float(upper)


def reliability(runs: pl.DataFrame) -> pl.DataFrame:
    """Return the reliability coefficients [%] over the single faults (thesis 6.4), by variant and method.

    `all_methods` is RC_i = 1 - t_i err_i / sum_j t_j err_j over the methods of the study, t the mean time and
    err the mean error; `thesis_methods` the same over those of them that the thesis compared. Null for fewer
    than two methods. `thesis_recomputed` follows from the thesis's own times and errors, and
    `thesis_printed` is its row, which does not.
    """
    groups = by_method(runs).filter(pl.col("kind") == SINGLE).group_by(*VARIANT, maintain_order=True)
    recomputed = published.reliability()
    rows: list[dict[str, Any]] = []
    for variant, group in groups:
        ours = _coefficients(group)
        five = _coefficients(group.filter(pl.col("method").is_in(published.METHODS)))
        rows += [
            {
                **dict(zip(VARIANT, variant, strict=True)),
                "method": name,
                "all_methods": ours.get(name),
                "thesis_methods": five.get(name),
                "thesis_recomputed": recomputed.get(name),
                "thesis_printed": published.RELIABILITY_PRINTED.get(name),
            }
            for name in group["method"]
        ]
    figures = ("all_methods", "thesis_methods", "thesis_recomputed", "thesis_printed")
    schema = {name: runs.schema[name] for name in (*VARIANT, "method")}
    return pl.DataFrame(rows, schema={**schema, **dict.fromkeys(figures, pl.Float64)})


def _coefficients(methods: pl.DataFrame) -> dict[str, float]:
    """Return the reliability coefficients [%] among `methods`; empty where they say nothing."""
    seconds, errors = (
        dict(zip(methods["method"], methods[name], strict=True)) for name in ("mean_seconds", "mean")
    )
    if len(errors) < 2 or not any(errors.values()):
        return {}
    return published.reliability(seconds, errors)


def across_variants(runs: pl.DataFrame) -> pl.DataFrame:
    """Return one row for each kind, method and variant: `cases` and the `mean` of the cases' mean errors [%].

    Only over the runs that every method has in every variant.
    """
    contestants = pl.struct(*VARIANT, "method").n_unique()
    common = runs.filter(contestants.over(*BLOCK) == contestants)
    return (
        by_case(common)
        .group_by("kind", "method", *VARIANT, maintain_order=True)
        .agg(pl.len().cast(pl.Int64).alias("cases"), pl.col("mean").mean())
    )
