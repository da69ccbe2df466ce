"""The thesis's comparison of methods, redone: runs the studies, writes the page and its tables and figures.

    python -m bench.comparison docs/comparison

Results are kept in studies/ and not computed twice. The page's text is in pages/comparison.md.jinja; each
finding that it states is checked here against the results, so that it cannot outlive them.
"""

import sys
import time
from pathlib import Path
from typing import Any

import polars as pl
from jinja2 import Environment, FileSystemLoader, StrictUndefined

import emaphm as ema
from emaphm.plotting.fitness_scans import draw_scans
from emaphm.plotting.svg import plain_style, svg
from emaphm.report.study import write_study_report
from emaphm.study import Plan, Store, run_study
from emaphm.study.analysis.statistics import VARIANT, by_case, by_method
from emaphm.study.thesis import published
from emaphm.study.thesis.fitness_study import fitness_study, fitness_table

STUDIES = Path("studies")
PAGES = Path(__file__).parent / "pages"
PLANS = ("thesis", "forms", "monitor", "hybrids")
DAY_S = 86_400
SINGLE, SEVERAL = "single faults", "several faults"


def run_all() -> dict[str, Store]:
    """Return the finished studies, doing what is missing of them."""
    stores = {}
    for name in PLANS:
        began = time.perf_counter()

        def tell(done: int, total: int, name: str = name, began: float = began) -> None:
            if sys.stderr.isatty() or done in {0, total}:
                spent = time.perf_counter() - began
                print(f"\r{name}: {done} of {total} runs, {spent:.0f} s", end="", file=sys.stderr)

        stores[name] = run_study(Plan.load(name), STUDIES / name, on_run=tell)
        print(file=sys.stderr)
    return stores


def wall_seconds(store: Store) -> float:
    """Return the time from a study's start to its last run, as its files tell."""
    last = max(part.stat().st_mtime for part in (store.folder / "runs").iterdir())
    return last - (store.folder / "plan.json").stat().st_mtime


def thesis_seconds() -> float:
    """Return what the thesis's runs took by its own times, ten runs a case, the dragonfly's not doubled."""
    cases = [case for case, faults in published.CASES.items() if len(faults) == 1]
    others = sum(published.MEAN_SECONDS[case][m] for case in cases for m in published.METHODS if m != "DA")
    return 10 * (others + sum(published.DRAGONFLY_SECONDS.values()))


def means(store: Store, kind: str) -> dict[str, dict[str, Any]]:
    """Return each method's row of `by_method` over the cases of one kind."""
    rows = by_method(store.results).filter(pl.col("kind") == kind)
    return {row["method"]: row for row in rows.iter_rows(named=True)}


def case_means(store: Store, method: str) -> dict[str, float]:
    """Return a method's mean error [%] by case."""
    rows = by_case(store.results).filter(pl.col("method") == method)
    return dict(zip(rows["case"], rows["mean"], strict=True))


def table(header: list[str], rows: list[list[str]]) -> str:
    """Return a Markdown table; numbers to the right."""
    rule = ["---", *["---:"] * (len(header) - 1)]
    return "\n".join(f"| {' | '.join(row)} |" for row in [header, rule, *rows])


def methods_table(store: Store) -> str:
    """Return error and cost of each method on the single faults, and on the multiple-fault case."""
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
    return table(header, rows)


def variants_table(store: Store, key: str) -> str:
    """Return the mean error of a study's methods on single and several faults, by one of its variants."""
    rows = by_method(store.results)
    lines = []
    for variant in rows.select(VARIANT).unique(maintain_order=True).iter_rows(named=True):
        mine = rows.filter(pl.all_horizontal(pl.col(name) == value for name, value in variant.items()))
        for method in mine["method"].unique(maintain_order=True):
            of = {row["kind"]: row for row in mine.filter(pl.col("method") == method).iter_rows(named=True)}
            name = method if key == "method" else f"{variant['equivalent']}, {variant['fitness']}"
            one, other = of[SINGLE], of[SEVERAL]
            lines.append(
                [
                    name,
                    f"{one['mean']:.2f}",
                    f"{one['median']:.2f}",
                    f"{other['mean']:.1f}",
                    f"{other['worst']:.1f}",
                    f"{one['evaluations']:.0f}",
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
    return table(header, lines)


def hybrids_table(store: Store) -> str:
    """Return error and cost of the hybrids, over all cases together."""
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
    return table(header, lines)


def contradictions_table() -> str:
    """Return the dragonfly's printed means beside the means of its rows, recomputed."""
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
    return table(header, lines)


def check(holds: bool, finding: str) -> None:
    """Stop where a finding of the page's text is not what the results say."""
    if not holds:
        raise SystemExit(f"no longer true, rewrite pages/comparison.md.jinja: {finding}")


def facts(stores: dict[str, Store]) -> dict[str, Any]:
    """Return the numbers that the page's text tells."""
    thesis = stores["thesis"]
    single, several = means(thesis, SINGLE), means(thesis, SEVERAL)
    scans = fitness_study(ema.Actuator.thesis())
    theirs = (pl.col("model") == "monitor") & (pl.col("equivalent") == "magnitude")
    ours = (pl.col("model") == "averaged") & (pl.col("equivalent") == "torque")
    bias = pl.col("bias_points").abs()
    biases = {
        name: scans.filter(chosen, pl.col("fitness") == fitness).select(bias.mean()).item()
        for name, chosen, fitness in (("theirs", theirs, "thesis"), ("ours", ours, "least_squares"))
    }
    forms = by_method(stores["forms"].results).filter(pl.col("kind") == SINGLE)
    monitor = means(stores["monitor"], SINGLE)
    wall = wall_seconds(thesis)
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


def check_findings(told: dict[str, Any]) -> None:
    """Check what the page's text says in words."""
    single, several, printed = told["single"], told["several"], told["printed"]
    for method in ("GA", "PSO", "DE"):
        check(single[method]["mean"] <= printed[method], f"{method} is at or below its printed mean")
    check(single["GWO"]["mean"] > printed["GWO"], "GWO stays above its printed mean")
    check(single["DA"]["mean"] < printed["DA"], "the corrected dragonfly is better than the printed one")
    check(single["DA as listed"]["mean"] > printed["DA"], "the dragonfly as listed is worse than printed")
    check(single["hybrid"]["mean"] < min(printed.values()), "hybrid beats the best printed mean")
    check(single["hybrid"]["evaluations"] <= 1000, "hybrid takes at most a tenth of the evaluations")
    swarms = ("GA", "PSO", "DE", "GWO", "DA")
    check(max(several[m]["within_5"] for m in swarms) <= 0.1, "no swarm finds the multiple faults")
    check(several["hybrid"]["within_5"] >= 0.9, "hybrid finds the multiple faults")
    check(told["biases"]["theirs"] > 20 * told["biases"]["ours"], "the thesis's set-up is biased")
    forms = told["forms"]
    check(
        min(forms, key=forms.__getitem__) in {(f, "least_squares") for f in ("torque", "active")},
        "torque or active current and least squares are the best forms",
    )
    check(told["wall_minutes"] < 12, "the study takes less than 12 minutes")


def main() -> None:
    """Write the page beside the folder given, and into the folder the report of the study `thesis`."""
    folder = Path(sys.argv[1])
    stores = run_all()
    told = facts(stores)
    thesis = stores["thesis"]
    write_study_report(
        thesis.results,
        thesis.plan.name,
        thesis.plan.description,
        folder,
        len(thesis.plan.tasks),
        thesis.plan.facts,
    )
    with plain_style():
        (folder / "figures" / "scans.svg").write_bytes(svg(draw_scans(told["scans"])))
    check_findings(told)
    environment = Environment(  # noqa: S701 - Markdown, of our own numbers
        loader=FileSystemLoader(PAGES), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    page = environment.get_template("comparison.md.jinja").render(
        **told,
        folder=folder.name,
        methods_table=methods_table(thesis),
        fitness_table=fitness_table(told["scans"]),
        forms_table=variants_table(stores["forms"], "current, fitness"),
        monitor_table=variants_table(stores["monitor"], "method"),
        hybrids_table=hybrids_table(stores["hybrids"]),
        contradictions_table=contradictions_table(),
    )
    folder.with_suffix(".md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
