"""The page that repeats the thesis's comparison of methods: text, tables and figures of four studies.

    python -m emaphm.report.comparison_page studies docs/comparison

reads the studies `thesis`, `forms`, `monitor` and `hybrids` in the folder `studies` and writes the page next
to the second folder. The text of the page is in comparison.md.jinja. Each finding stated there is checked
here against the results, so that the text cannot become outdated unnoticed.
"""

import sys
from pathlib import Path
from typing import Any

import polars as pl

from emaphm.actuator import Actuator
from emaphm.errors import StudyError
from emaphm.plotting.fitness_scans import draw_scans
from emaphm.plotting.svg import plain_style, svg
from emaphm.report.markdown import mixed
from emaphm.report.study import write_study_report
from emaphm.study import Store
from emaphm.study.analysis.statistics import VARIANT, by_case, by_method
from emaphm.study.thesis import published
from emaphm.study.thesis.fitness_study import fitness_study, fitness_table
from emaphm.text_table import markdown_table

PLANS = ("thesis", "forms", "monitor", "hybrids")
DAY_S = 86_400
SINGLE, SEVERAL = "single faults", "several faults"


def finished(studies: Path) -> dict[str, Store]:
    """Return the studies in a folder by name; `StudyError` if one is missing or not complete."""
    stores = {name: Store.open(studies / name) for name in PLANS}
    for name, store in stores.items():
        if store.results.height < store.plan.total:
            raise StudyError(
                f"{store.folder}: {store.results.height} of {store.plan.total} runs; finish it with: "
                f"emaphm study run {name} -o {store.folder}"
            )
    return stores


def thesis_seconds() -> float:
    """Return the total time [s] of the thesis's runs, ten per case, by its printed times.

    The dragonfly's times are taken from its own tables, where they are not doubled.
    """
    cases = [case for case, faults in published.CASES.items() if len(faults) == 1]
    others = sum(published.MEAN_SECONDS[case][m] for case in cases for m in published.METHODS if m != "DA")
    return 10 * (others + sum(published.DRAGONFLY_SECONDS.values()))


def means(store: Store, kind: str) -> dict[str, dict[str, Any]]:
    """Return the row of `by_method` of each method, over the cases of one kind."""
    rows = by_method(store.results).filter(pl.col("kind") == kind)
    return {row["method"]: row for row in rows.iter_rows(named=True)}


def case_means(store: Store, method: str) -> dict[str, float]:
    """Return the mean error of a method [%] by case."""
    rows = by_case(store.results).filter(pl.col("method") == method)
    return dict(zip(rows["case"], rows["mean"], strict=True))


def methods_table(store: Store) -> str:
    """Return a table of error and cost of each method for the single faults and the multiple faults."""
    single, several = means(store, SINGLE), means(store, SEVERAL)
    rows = [
        [
            method,
            f"{row['mean']:.2f}",
            "–" if row["thesis"] is None else f"{row['thesis']:.2f}",
            f"{row['median']:.2f}",
            f"{100 * row['within_2']:.0f}",
            f"{several[method]['mean']:.1f}",
            f"{100 * several[method]['within_2']:.0f} / {100 * several[method]['within_5']:.0f}",
            f"{row['evaluations']:.0f}",
            f"{row['reference_runs']:.1f}",
            f"{row['seconds']:.2f}",
        ]
        for method, row in sorted(single.items(), key=lambda item: item[1]["mean"])
    ]
    header = [
        "method",
        "single faults: mean error, %",
        "thesis, %",
        "median, %",
        "≤ 2 %, % of runs",
        "multiple faults: mean error, %",
        "≤ 2 / ≤ 5 %, % of runs",
        "evaluations",
        "reference runs",
        "time of a run, s",
    ]
    return markdown_table(header, rows)


def variants_table(store: Store, key: str) -> str:
    """Return a table of the methods' mean errors for single and several faults, by variant of the study."""
    rows = by_method(store.results)
    lines = []
    for variant in rows.select(VARIANT).unique(maintain_order=True).iter_rows(named=True):
        of_variant = rows.filter(pl.all_horizontal(pl.col(name) == value for name, value in variant.items()))
        for method in of_variant["method"].unique(maintain_order=True):
            of_method = of_variant.filter(pl.col("method") == method)
            by_kind = {row["kind"]: row for row in of_method.iter_rows(named=True)}
            name = method if key == "method" else f"{variant['equivalent']}, {variant['fitness']}"
            single, several = by_kind[SINGLE], by_kind[SEVERAL]
            lines.append(
                [
                    name,
                    f"{single['mean']:.2f}",
                    f"{single['median']:.2f}",
                    f"{several['mean']:.1f}",
                    f"{several['worst']:.1f}",
                    f"{single['evaluations']:.0f}",
                ]
            )
    header = [
        key,
        "single faults: mean error, %",
        "median, %",
        "several faults: mean error, %",
        "worst, %",
        "evaluations",
    ]
    return markdown_table(header, lines)


def hybrids_table(store: Store) -> str:
    """Return a table of error and cost of the hybrids, over all cases together."""
    error = pl.col("error_percent")
    random = pl.col("case").str.starts_with("random")
    rows = store.results.group_by("method", maintain_order=True).agg(
        error.filter(random).median().alias("median"),
        error.filter(random).max().alias("worst"),
        (error.filter(~random) <= 5).mean().alias("found"),
        pl.col("evaluations").mean(),
        pl.col("reference_runs").mean(),
    )
    lines = [
        [
            row["method"],
            f"{row['median']:.2f}",
            f"{row['worst']:.1f}",
            f"{100 * row['found']:.0f}",
            f"{row['evaluations']:.0f}",
            f"{row['reference_runs']:.1f}",
        ]
        for row in rows.iter_rows(named=True)
    ]
    header = [
        "method",
        "random: median error, %",
        "worst, %",
        "heavy and multiple: ≤ 5 %, % of runs",
        "evaluations",
        "reference runs",
    ]
    return markdown_table(header, lines)


def contradictions_table() -> str:
    """Return a table of the dragonfly's printed means, and of the means recomputed from its printed rows."""
    rows = published.dragonfly_means()
    counted = published.contradicting_rows().group_by("case").len()
    counts = dict(zip(counted["case"], counted["len"], strict=True))
    lines = [
        [
            row["case"],
            f"{row['error_printed']:.2f}",
            f"{row['error_of_rows']:.2f}",
            f"{row['error']:.2f}",
            f"{counts.get(row['case'], 0)} of 10",
        ]
        for row in rows.iter_rows(named=True)
    ]
    header = [
        "case",
        "printed mean, %",
        "mean of the printed rows, %",
        "mean recomputed from the faults found, %",
        "rows whose error follows from no formula",
    ]
    return markdown_table(header, lines)


def check(holds: bool, finding: str) -> None:
    """Refuse to write a page with a finding that the results contradict."""
    if not holds:
        raise StudyError(f"no longer true, rewrite report/comparison.md.jinja: {finding}")


def facts(stores: dict[str, Store]) -> dict[str, Any]:
    """Return the numbers in the text of the page."""
    thesis = stores["thesis"]
    single, several = means(thesis, SINGLE), means(thesis, SEVERAL)
    scans = fitness_study(Actuator.thesis())
    of_thesis = (pl.col("model") == "monitor") & (pl.col("equivalent") == "magnitude")
    of_emaphm = (pl.col("model") == "averaged") & (pl.col("equivalent") == "torque")
    bias = pl.col("bias_points").abs()
    biases = {
        name: scans.filter(chosen, pl.col("fitness") == fitness).select(bias.mean()).item()
        for name, chosen, fitness in (("theirs", of_thesis, "thesis"), ("ours", of_emaphm, "least_squares"))
    }
    forms = by_method(stores["forms"].results).filter(pl.col("kind") == SINGLE)
    monitor = means(stores["monitor"], SINGLE)
    wall = thesis.elapsed_seconds
    return {
        "single": single,
        "several": several,
        "printed": published.ERROR,
        "wall_minutes": wall / 60,
        "runs": thesis.results.height,
        "thesis_days": thesis_seconds() / DAY_S,
        "ratio": thesis_seconds() / wall,
        "scans": scans,
        "biases": biases,
        "forms": {(row["equivalent"], row["fitness"]): row["mean"] for row in forms.iter_rows(named=True)},
        "monitor": monitor,
        "cases": {method: case_means(thesis, method) for method in single},
        "recomputed": published.reliability(),
        "contradicting": published.contradicting_rows().height,
        "by_more_than_1": published.recomputed_rows()
        .filter(
            pl.min_horizontal(
                (pl.col(name) - pl.col("error_printed")).abs() for name in published.FORMULAS
            ).fill_null(100.0)
            > 1
        )
        .height,
    }


def check_findings(results: dict[str, Any]) -> None:
    """Check the findings that the text of the page states in words."""
    single, several, printed = results["single"], results["several"], results["printed"]
    for method in ("GA", "PSO", "DE"):
        check(single[method]["mean"] <= printed[method], f"{method} is at or below its printed mean")
    check(single["GWO"]["mean"] > printed["GWO"], "GWO stays above its printed mean")
    check(single["DA"]["mean"] < printed["DA"], "the corrected dragonfly is better than the printed one")
    check(single["DA as listed"]["mean"] > printed["DA"], "the dragonfly as listed is worse than printed")
    check(single["hybrid"]["mean"] < min(printed.values()), "hybrid beats the best printed mean")
    check(single["hybrid"]["evaluations"] <= 1000, "hybrid needs at most a tenth of the evaluations")
    swarms = ("GA", "PSO", "DE", "GWO", "DA")
    check(max(several[m]["within_5"] for m in swarms) <= 0.1, "no swarm finds the multiple faults")
    check(several["hybrid"]["within_5"] >= 0.9, "hybrid finds the multiple faults")
    check(results["biases"]["theirs"] > 20 * results["biases"]["ours"], "the thesis's set-up is biased")
    forms = results["forms"]
    check(
        min(forms, key=forms.__getitem__) in {(f, "least_squares") for f in ("torque", "active")},
        "torque or active current and least squares are the best forms",
    )
    check(results["wall_minutes"] < 12, "the study takes less than 12 minutes")


def write_comparison(stores: dict[str, Store], folder: Path) -> None:
    """Write the page next to `folder`, and the report of the study `thesis` into `folder`."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    results, thesis = facts(stores), stores["thesis"]
    write_study_report(
        thesis.results,
        thesis.plan.name,
        thesis.plan.description,
        folder,
        thesis.plan.total,
        thesis.plan.facts,
    )
    with plain_style():
        (folder / "figures" / "scans.svg").write_bytes(svg(draw_scans(results["scans"])))
    check_findings(results)
    environment = Environment(  # noqa: S701 - Markdown with computed numbers only
        loader=PackageLoader("emaphm", "report"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    page = environment.get_template("comparison.md.jinja").render(
        **results,
        folder=folder.name,
        warnings=mixed([revision for store in stores.values() for revision in store.results["revision"]]),
        methods_table=methods_table(thesis),
        fitness_table=fitness_table(results["scans"]),
        forms_table=variants_table(stores["forms"], "current, fitness"),
        monitor_table=variants_table(stores["monitor"], "method"),
        hybrids_table=hybrids_table(stores["hybrids"]),
        contradictions_table=contradictions_table(),
    )
    folder.with_suffix(".md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    write_comparison(finished(Path(sys.argv[1])), Path(sys.argv[2]))
