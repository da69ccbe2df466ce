"""The verbs `study run`, `study report` and `study plans`: comparison of methods over many cases."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, Parameter

from emaphm.cli.interruption import resumable
from emaphm.cli.options import (
    AsJson,
    Execution,
    Force,
)
from emaphm.cli.output import counter, show
from emaphm.errors import OutputError
from emaphm.input_files import is_folder

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
"""Heading and number format of each printed column, by its key in the JSON."""

app = App(name="study", help="Compare methods of identification over many cases with known faults.")


@app.command
def run(
    plan: Annotated[
        str,
        Parameter(help="Plan: a TOML file, or the name of a built-in plan listed by 'emaphm study plans'."),
    ],
    *,
    out: Annotated[
        Path,
        Parameter(name=("--out", "-o"), help="Folder for the results: a new one, or one of the same plan."),
    ],
    execution: Execution = Execution(),  # noqa: B008 - frozen
    share: Annotated[
        float,
        Parameter(help="Share of the runs to do now, above 0 and up to 1: the first of each kind, e.g. 0.1."),
    ] = 1.0,
    mix: Annotated[
        bool,
        Parameter(
            negative="", help="Keep results computed with another version of the models in the folder."
        ),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Do the runs of a plan whose results are missing; after an interruption, the same command resumes."""
    execution.check()
    from emaphm.study import Plan, run_study

    loaded = Plan.load(plan)
    hint = f"finished results are stored in {out}; the same command resumes"
    with resumable(hint), counter(f"study {loaded.name}", as_json) as count:
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
        f"{_summary(store, methods)}\nResults in {out}; for tables and figures: emaphm study report {out}",
        as_json,
    )


@app.command
def report(
    folder: Annotated[Path, Parameter(help="Folder with the results of 'emaphm study run'.")],
    *,
    out: Annotated[
        Path | None, Parameter(name=("--out", "-o"), help="Folder for the report; default FOLDER/report.")
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Write the tables and figures of a study, finished or unfinished: Markdown, CSV and one HTML page.

    For a plan with a page of its own, such as accuracy or limits, this page and its figures are written
    instead.
    """
    from emaphm.study import Store

    if out is not None and not force and is_folder(out, OutputError) and _has_files(out):
        raise OutputError(
            f"{out}: contains files already; give another folder with --out, or --force to write there"
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
    name: Annotated[
        str | None,
        Parameter(
            help="Print the TOML of this plan, as a template for a new plan; by default, list all plans."
        ),
    ] = None,
    *,
    as_json: AsJson = False,
) -> None:
    """List the built-in plans, or print one of them."""
    from emaphm.errors import StudyError, nearest
    from emaphm.study import BUILT_IN, Plan
    from emaphm.study.plan import built_in_text

    if name is not None:
        if name not in BUILT_IN:
            raise StudyError(
                f"unknown plan '{name}'{nearest(name, BUILT_IN)}; only built-in plans can be printed"
            )
        show({"name": name, "toml": built_in_text(name)}, built_in_text(name).rstrip(), as_json)
        return
    built_in_plans = [Plan.load(built_in) for built_in in BUILT_IN]
    values = {
        "plans": [
            {"name": plan.name, "runs": plan.total, "description": plan.description}
            for plan in built_in_plans
        ]
    }
    show(values, "\n".join(map(_line, built_in_plans)), as_json)


def _line(plan: "Plan") -> str:
    return f"{plan.name:<10}{plan.total:>5} runs  {plan.description}"


def _methods(store: "Store") -> list[dict[str, Any]]:
    """Return the errors of each method, over the runs that all methods have finished.

    A study with several variants has one row per variant and method, with the columns that distinguish
    variants.
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
    """Return the progress of a study, and a text table of its `methods`."""
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
            format(value, COLUMNS[name][1]) if name in COLUMNS else str(value)
            for name, value in method.items()
        )
        for method in methods
    ]
    return f"{summary}\n{format_table(header, rows)}"


def _has_files(folder: Path) -> bool:
    try:
        return any(folder.iterdir())
    except OSError as error:
        raise OutputError(
            f"{folder}: cannot be read ({error.strerror}); let this user read the folder, or give another one"
        ) from None
