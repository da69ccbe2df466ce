"""Significance of differences between methods: rank tests over runs of the same case and seed.

A block is one run of one case, with the same seed for all methods. The tests are valid for the cases of the
study; whether the result holds for other cases depends on the choice of these cases.
"""

from itertools import combinations
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import ArrayLike

from emaphm.arrays import Array
from emaphm.study.analysis.statistics import BLOCK, VARIANT

FEWEST_BLOCKS = 6
"""Smallest number of blocks for a test: with 5, even five wins of five have p = 2/2⁵ > 0.05."""

SIGNIFICANT = 0.05
"""Largest p-value that counts as a significant difference."""


def blocks(runs: pl.DataFrame) -> tuple[list[str], Array]:
    """Return the methods of one variant's `runs`, and their errors [%], (blocks, methods); NaN if missing."""
    rows = runs.sort("index")
    methods = rows["method"].unique(maintain_order=True).to_list()
    # Cases of two groups may have the same name, but different faults or recordings.
    keys = list(dict.fromkeys(zip(*(rows[name] for name in BLOCK), strict=True)))
    errors = np.full((len(keys), len(methods)), np.nan)
    block = {key: i for i, key in enumerate(keys)}
    column = {method: j for j, method in enumerate(methods)}
    for *key, method, error in rows.select(*BLOCK, "method", "error_percent").iter_rows():
        errors[block[tuple(key)], column[method]] = error
    return methods, errors


def friedman(runs: pl.DataFrame) -> pl.DataFrame:
    """Return Friedman's test of equal ranks of all methods, by variant.

    Columns: those of `VARIANT`; the numbers of `methods`, of complete `blocks` and of `incomplete` blocks,
    which are left out; `statistic` (corrected for ties) and `p`, null for fewer than three methods or
    `FEWEST_BLOCKS` blocks.
    """
    rows = []
    for variant, group in runs.sort("index").group_by(*VARIANT, maintain_order=True):
        methods, errors = blocks(group)
        complete = _complete(errors)
        statistic, p = _friedman(complete)
        rows.append(
            {
                **dict(zip(VARIANT, variant, strict=True)),
                "methods": len(methods),
                "blocks": len(complete),
                "incomplete": len(errors) - len(complete),
                "statistic": statistic,
                "p": p,
            }
        )
    counts = dict.fromkeys(("methods", "blocks", "incomplete"), pl.Int64)
    figures = dict.fromkeys(("statistic", "p"), pl.Float64)
    return pl.DataFrame(rows, schema={**_variant_schema(runs), **counts, **figures})


def _friedman(errors: Array) -> tuple[float | None, float | None]:
    from scipy.stats import friedmanchisquare

    if len(errors) < FEWEST_BLOCKS or errors.shape[1] < 3:
        return None, None
    if np.all(errors == errors[:, :1]):  # ties of all methods in all blocks: the statistic would be 0/0
        return 0.0, 1.0
    test = friedmanchisquare(*errors.T)
    return float(test.statistic), float(test.pvalue)


def mean_ranks(runs: pl.DataFrame) -> pl.DataFrame:
    """Return `mean_rank` by variant and method over the complete `blocks`; 1 is the least error."""
    from scipy.stats import rankdata

    rows: list[dict[str, Any]] = []
    for variant, group in runs.sort("index").group_by(*VARIANT, maintain_order=True):
        methods, errors = blocks(group)
        complete = _complete(errors)
        ranks = rankdata(complete, axis=1).mean(axis=0).tolist() if len(complete) else [None] * len(methods)
        rows += [
            {
                **dict(zip(VARIANT, variant, strict=True)),
                "method": m,
                "blocks": len(complete),
                "mean_rank": rank,
            }
            for m, rank in zip(methods, ranks, strict=True)
        ]
    columns = {"method": pl.String, "blocks": pl.Int64, "mean_rank": pl.Float64}
    return pl.DataFrame(rows, schema={**_variant_schema(runs), **columns})


def pairs(runs: pl.DataFrame) -> pl.DataFrame:
    """Return Wilcoxon's signed-rank test of each pair of methods, by variant.

    Columns: those of `VARIANT`, `method` and `other`; the number of `blocks` with both methods, and of those
    in which `method` has the `lower` and the `higher` error; `median_difference` [%], method minus other; `p`
    (two-sided, without blocks of equal errors; 1 if all errors are equal), null for fewer than
    `FEWEST_BLOCKS`; and `p_holm`, corrected for the number of pairs tested in the variant.
    """
    rows: list[dict[str, Any]] = []
    for variant, group in runs.sort("index").group_by(*VARIANT, maintain_order=True):
        methods, errors = blocks(group)
        tests = [
            {**dict(zip(VARIANT, variant, strict=True)), "method": methods[i], "other": methods[j]}
            | _compare(errors[:, i] - errors[:, j])
            for i, j in combinations(range(len(methods)), 2)
        ]
        tested = [test for test in tests if test["p"] is not None]
        for test, p in zip(tested, holm([test["p"] for test in tested]), strict=True):
            test["p_holm"] = float(p)
        rows += tests
    counts = dict.fromkeys(("blocks", "lower", "higher"), pl.Int64)
    figures = dict.fromkeys(("median_difference", "p", "p_holm"), pl.Float64)
    names = dict.fromkeys(("method", "other"), pl.String)
    return pl.DataFrame(rows, schema={**_variant_schema(runs), **names, **counts, **figures})


def _compare(differences: Array) -> dict[str, Any]:
    """Return the test of the differences of two methods' errors, NaN for missing runs."""
    known = differences[~np.isnan(differences)]
    return {
        "blocks": known.size,
        "lower": int(np.sum(known < 0)),
        "higher": int(np.sum(known > 0)),
        "median_difference": float(np.median(known)) if known.size else None,
        "p": _wilcoxon(known),
        "p_holm": None,
    }


def _wilcoxon(differences: Array) -> float | None:
    from scipy.stats import wilcoxon

    if differences.size < FEWEST_BLOCKS:
        return None
    if not np.any(differences):
        return 1.0
    return float(wilcoxon(differences).pvalue)


def holm(p_values: ArrayLike) -> Array:
    """Return p-values (n,), corrected for n multiple tests (Holm 1979).

    The smallest p-value is multiplied by n, the next by n - 1 and so on; each is at least the previous one.

    References
    ----------
    S. Holm (1979): A simple sequentially rejective multiple test procedure. Scand. J. Statistics 6, 65-70.
    """
    p = np.asarray(p_values, float)
    order = np.argsort(p, kind="stable")
    corrected = np.empty_like(p)
    corrected[order] = np.minimum(np.maximum.accumulate(p[order] * np.arange(p.size, 0, -1)), 1)
    return corrected


def _complete(errors: Array) -> Array:
    return errors[~np.isnan(errors).any(axis=1)]


def _variant_schema(runs: pl.DataFrame) -> dict[str, Any]:
    return {name: runs.schema[name] for name in VARIANT}
