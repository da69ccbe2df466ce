"""Statistics of the finished runs of a study: errors, success and cost of each method.

Each function takes the table of runs (`emaphm.study.store.SCHEMA`) and returns a table with one row per
group. The study may be incomplete: missing values are null.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from emaphm.actuator.faults import HEALTHY, NAMES, Faults
from emaphm.study.thesis import published

VARIANT = ("rig", "model", "fitness", "equivalent", "noise_A")
"""Columns that distinguish the variants of a study; methods are compared within a variant."""

BLOCK = ("case", "run", "seed")
"""Columns that are equal for compared methods: case, number of the run, and seed of the recording."""

LIMITS_PERCENT = (1, 2, 5)
"""Limits of the error [%] below which a run counts as successful, in the columns `within_1`, …."""

SINGLE, SEVERAL, NONE = "single faults", "several faults", "no faults"
"""Kinds of cases. The thesis's averages are over the single faults."""

RESAMPLES = 2000
"""Resamples of a bootstrap: fifty of them are beyond each end of the 95 % interval."""

BOOTSTRAP_SEED = 0

THESIS_CASES = {tuple(Faults(**faults).vector.tolist()): case for case, faults in published.CASES.items()}
"""Names of the thesis's cases by their faults; a study may use other names."""

THESIS_AVERAGED = [case for case, faults in published.CASES.items() if len(faults) == 1]
"""The cases of the thesis's printed averages."""


def prepared(runs: pl.DataFrame) -> pl.DataFrame:
    """Return the runs in the order of the plan, with the `kind` of each case, and its name in the thesis."""
    truths = runs["truth"].to_list()
    return runs.with_columns(
        pl.Series("kind", [_kind(truth) for truth in truths], dtype=pl.String),
        pl.Series("thesis_case", [THESIS_CASES.get(tuple(truth)) for truth in truths], dtype=pl.String),
    ).sort("index")


def _kind(truth: Sequence[float]) -> str:
    healthy = zip(NAMES, truth, HEALTHY.vector, strict=True)
    # The direction of an eccentricity is not a separate fault.
    faults = sum(value != nominal for name, value, nominal in healthy if name != "eccentricity_phase")
    return (NONE, SINGLE)[faults] if faults < 2 else SEVERAL


def by_case(runs: pl.DataFrame) -> pl.DataFrame:
    """Return one row for each variant, case and method.

    Columns: those of `VARIANT`, `kind`, `case`, `method`, the number of `runs`; `mean`, `median`,
    `lower_quartile`, `upper_quartile`, `worst` and `deviation` (standard deviation; null for one run) of the
    error [%]; `within_1`, `within_2`, `within_5`, the shares of runs with at most this error; the means
    `evaluations` and `reference_runs`; the median time `seconds` and `mean_seconds`; `thesis_case`, the
    thesis's name of a case with these faults, and `thesis` and `thesis_seconds`, the means printed there.
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
    """Return the runs whose case, number and seed all methods of their variant have.

    Means over different cases would compare the cases and not the methods; so would the worst errors of
    different numbers of runs.
    """
    methods = pl.col("method").n_unique()
    return runs.filter(methods.over(*VARIANT, *BLOCK) == methods.over(*VARIANT))


def by_method(runs: pl.DataFrame) -> pl.DataFrame:
    """Return one row for each variant, kind of case and method, over the `comparable` runs.

    Columns as in `by_case`, with these differences: `cases` is the number of cases; `mean`, the shares,
    `evaluations`, `reference_runs` and `mean_seconds` are means of the cases' means (the average of the
    thesis); the other statistics are over all runs together. `lower95` and `upper95` are the ends of the
    bootstrap interval of the mean, null if a case has one run. `thesis` and `thesis_seconds` are the printed
    averages if the cases are the ten cases of these averages, otherwise the means of the printed values of
    the same cases, null if the thesis lacks a case.
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

    Runs are resampled within each case: the cases are fixed, only the runs are random. None if a case has
    fewer than two runs, because its scatter is then unknown.
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

    `all_methods` is RC_i = 1 - t_i err_i / sum_j t_j err_j over the methods of the study, with the mean time
    t and the mean error err; `thesis_methods` is the same over the methods that the thesis compared. Null for
    fewer than two methods. `thesis_recomputed` is computed from the thesis's own times and errors;
    `thesis_printed` is the printed value, which differs from it.
    """
    groups = by_method(runs).filter(pl.col("kind") == SINGLE).group_by(*VARIANT, maintain_order=True)
    recomputed = published.reliability()
    rows: list[dict[str, Any]] = []
    for variant, group in groups:
        of_all = _coefficients(group)
        of_five = _coefficients(group.filter(pl.col("method").is_in(published.METHODS)))
        rows += [
            {
                **dict(zip(VARIANT, variant, strict=True)),
                "method": name,
                "all_methods": of_all.get(name),
                "thesis_methods": of_five.get(name),
                "thesis_recomputed": recomputed.get(name),
                "thesis_printed": published.RELIABILITY_PRINTED.get(name),
            }
            for name in group["method"]
        ]
    figures = ("all_methods", "thesis_methods", "thesis_recomputed", "thesis_printed")
    schema = {name: runs.schema[name] for name in (*VARIANT, "method")}
    return pl.DataFrame(rows, schema={**schema, **dict.fromkeys(figures, pl.Float64)})


def _coefficients(methods: pl.DataFrame) -> dict[str, float]:
    """Return the reliability coefficients [%] among `methods`; empty if they are undefined."""
    seconds, errors = (
        dict(zip(methods["method"], methods[name], strict=True)) for name in ("mean_seconds", "mean")
    )
    if len(errors) < 2 or not any(errors.values()):
        return {}
    return published.reliability(seconds, errors)


def across_variants(runs: pl.DataFrame) -> pl.DataFrame:
    """Return one row for each kind, method and variant: `cases` and the `mean` of the cases' mean errors [%].

    Only runs that all methods have in all variants are included.
    """
    contestants = pl.struct(*VARIANT, "method").n_unique()
    common = runs.filter(contestants.over(*BLOCK) == contestants)
    return (
        by_case(common)
        .group_by("kind", "method", *VARIANT, maintain_order=True)
        .agg(pl.len().cast(pl.Int64).alias("cases"), pl.col("mean").mean())
    )
