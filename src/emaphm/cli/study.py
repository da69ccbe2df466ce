"""`emaphm study …`: comparing methods over many cases."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, Parameter

from emaphm.cli.interruption import going_on
from emaphm.cli.options import (
    AsJson,
    Execution,
    Force,
)
from emaphm.cli.output import counter, show
from emaphm.errors import OutputError

if TYPE_CHECKING:
    from emaphm.study import Plan, Store

COLUMNS = {
    "median_error_percent": ("median error, %", ".2f"),
    "mean_error_percent": ("mean, %", ".2f"),
    "worst_error_percent": ("worst, %", ".2f"),
    "within_2_percent": ("within 2 %, % of runs", ".0f"),
    "mean_evaluations": ("evaluations", ".0f"),
    "median_seconds": ("time of a run, s", ".2f"),
}
"""What is said of a method, by its name in the JSON: the column's heading and its format."""

app = App(name="study", help="Compare methods of identification over many cases.")


@app.command
def run(
    plan: Annotated[str, Parameter(help="TOML of the plan, or the name of one that 'study plans' lists.")],
    *,
    out: Annotated[
        Path, Parameter(name=("--out", "-o"), help="Folder for the results, new or of this plan.")
    ],
    execution: Execution = Execution(),  # noqa: B008 - frozen
    share: Annotated[
        float, Parameter(help="Share of the runs to do now, the first of each kind: e.g. 0.1 for a trial.")
    ] = 1.0,
    mix: Annotated[
        bool, Parameter(negative="", help="Let results of another version of the models stand.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Do what is missing of a plan; start it again, and it goes on where it stopped."""
    execution.check()
    from emaphm.study import Plan, run_study

    loaded = Plan.load(plan)
    how = f"what finished is kept in {out}; the same command goes on"
    with going_on(how), counter(f"study {loaded.name}", as_json) as count:
        store = run_study(
            loaded,
            out,
            share=share,
            workers=execution.workers,
            scheduler=execution.scheduler,
            mix=mix,
            on_run=count,
        )
    methods = _methods(store)
    values = {
        "plan": loaded.name,
        "folder": str(out),
        "runs": store.results.height,
        "done_again": list(store.damaged),
        "methods": methods,
    }
    show(
        values,
        f"{_summary(store, methods)}\nResults in {out}; see them with: emaphm study report {out}",
        as_json,
    )


@app.command
def report(
    folder: Annotated[Path, Parameter(help="Folder that 'emaphm study run' wrote.")],
    *,
    out: Annotated[
        Path | None, Parameter(name=("--out", "-o"), help="Folder for the report; FOLDER/report if left out.")
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Write the tables and figures of a study, finished or not: Markdown, CSV and one HTML page.

    A plan that names a page of its own, as accuracy and limits do, gives that page and its figures instead.
    """
    from emaphm.study import Store

    if out is not None and not force and out.is_dir() and any(out.iterdir()):
        raise OutputError(
            f"{out}: holds files already; give another folder with --out, or --force to write there"
        )
    store, place = Store.open(folder), out or folder / "report"
    plan, total = store.plan, store.plan.total
    if plan.page is not None:
        from emaphm.report.study_pages import write_study_page

        written = write_study_page(store, place)
    else:
        from emaphm.report.study import write_study_report

        written = write_study_report(store.results, plan.name, plan.description, place, total, plan.facts)
    methods = _methods(store)
    values = {
        "plan": plan.name,
        "runs": store.results.height,
        "of": total,
        "files": list(map(str, written)),
        "methods": methods,
    }
    pages = "\n".join(f"written: {path}" for path in written if path.suffix in (".html", ".md"))
    show(values, f"{_summary(store, methods)}\n{pages}", as_json)


@app.command
def plans(
    name: Annotated[str | None, Parameter(help="Print this plan's TOML, to start one's own from.")] = None,
    *,
    as_json: AsJson = False,
) -> None:
    """List the built-in plans, or print one of them."""
    from emaphm.errors import StudyError, nearest
    from emaphm.study import BUILT_IN, Plan
    from emaphm.study.plan import built_in_text

    if name is not None:
        if name not in BUILT_IN:
            raise StudyError(f"unknown plan '{name}'{nearest(name, BUILT_IN)}; only built-in ones are listed")
        show({"name": name, "toml": built_in_text(name)}, built_in_text(name).rstrip(), as_json)
        return
    every = [Plan.load(built_in) for built_in in BUILT_IN]
    values = {
        "plans": [{"name": plan.name, "runs": plan.total, "description": plan.description} for plan in every]
    }
    show(values, "\n".join(map(_line, every)), as_json)


def _line(plan: "Plan") -> str:
    return f"{plan.name:<10}{plan.total:>5} runs  {plan.description}"


def _methods(store: "Store") -> list[dict[str, Any]]:
    """Return each method's errors, over the runs that all methods have finished.

    Of a study with several variants, those of each, with what they differ by.
    """
    import polars as pl

    from emaphm.study.analysis.statistics import VARIANT, comparable, prepared

    runs = comparable(prepared(store.results))
    variant = [name for name in VARIANT if store.results[name].n_unique() > 1]
    error = pl.col("error_percent")
    by_method = runs.group_by(*variant, "method", maintain_order=True).agg(
        error.median().alias("median_error_percent"),
        error.mean().alias("mean_error_percent"),
        error.max().alias("worst_error_percent"),
        (100 * (error <= 2).mean()).alias("within_2_percent"),
        pl.col("evaluations").mean().alias("mean_evaluations"),
        pl.col("seconds").median().alias("median_seconds"),
    )
    return by_method.sort(*variant, "mean_error_percent").to_dicts()


def _summary(store: "Store", methods: list[dict[str, Any]]) -> str:
    """Return how far a study is, and each of its `methods`, as a table of text."""
    from emaphm.text_table import format_table

    total = store.plan.total
    summary = f"{store.plan.name}: {store.results.height} of {total} runs"
    if store.damaged:
        again = "done again" if store.results.height == total else "to be done again"
        summary += f"; damaged, and {again}: {'; '.join(store.damaged)}"
    if not methods:
        return summary
    header = tuple(COLUMNS.get(name, (name.replace("_", " "),))[0] for name in methods[0])
    rows = [
        tuple(
            format(value, COLUMNS[name][1]) if name in COLUMNS else str(value) for name, value in one.items()
        )
        for one in methods
    ]
    return f"{summary}\n{format_table(header, rows)}"
