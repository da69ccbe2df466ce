"""The page of a study of a drive: how well faults are found behind it."""

from collections.abc import Callable

import numpy as np
import polars as pl

from emaphm.errors import StudyError
from emaphm.report.markdown import incomplete, mixed, percent
from emaphm.study.analysis.rates import (
    coverage,
    detection,
    errors,
    explained,
    false_alarms,
)
from emaphm.study.plan import PageRow, Plan
from emaphm.text_table import markdown_table

HEADINGS = {
    "pmsm": "A motor under field-oriented control",
    "six_step": "A motor under six-step control",
}
"""By page."""

HEADER = (
    "single faults: mean / worst error, %",
    "random faults: median / 95th percentile / worst, %",
    "cases",
    "coverage: mean",
    "explained",
    "small faults detected",
    "false alarms",
)


def drive_page(plan: Plan, runs: pl.DataFrame) -> str:
    """Return the page as Markdown; `runs` are the finished trials of `plan`.

    Raises
    ------
    StudyError
        The plan has no sections, or a row of the page has no finished trial.
    """
    if not plan.sections:
        raise StudyError(f"page '{plan.page}' needs [[sections]] in its plan; add them")
    lines = [
        f"# {HEADINGS[str(plan.page)]}\n",
        *incomplete(runs.height, plan.total),
        *mixed(runs["revision"].to_list()),
        f"Made by `make study`, from the plan `{plan.name}`. {plan.description}\n",
    ]
    for section in plan.sections:
        lines.append(f"## {section.title}\n\n{section.note}\n")
        rows = [[row.text, *_cells(row, runs)] for row in section.rows]
        lines.append(markdown_table([section.label, *HEADER], rows) + "\n")
    return "\n".join(lines)


def _cells(row: PageRow, runs: pl.DataFrame) -> list[str]:
    """Return the cells of a row, in the order of `HEADER`; a dash where the plan has no such cases."""
    mine = runs.filter(pl.col("rig") == row.rig, pl.col("method") == row.method)
    single, random, small, healthy = (
        mine.filter(pl.col("case_kind") == kind) for kind in ("named", "random", "small", "healthy")
    )
    if random.is_empty():
        raise StudyError(f"no run of '{row.rig}' with random cases is finished; go on with the study")
    found = errors(random)
    return [
        _where(single, lambda rows: f"{_size(errors(rows).mean())} / {_size(errors(rows).max())}"),
        f"{_size(np.median(found))} / {_size(np.percentile(found, 95))} / {_size(found.max())}",
        str(random.height),
        f"{100 * coverage(random).mean():.0f} %",
        percent(explained(random)),
        _where(small, lambda rows: f"{100 * detection(rows):.0f} %"),
        _where(healthy, lambda rows: f"{100 * false_alarms(rows):.1f} %"),
    ]


def _size(error: float) -> str:
    """Return an error with two digits, and all of those before the point."""
    return f"{error:.2g}" if error < 99.5 else f"{error:.0f}"


def _where(rows: pl.DataFrame, cell: Callable[[pl.DataFrame], str]) -> str:
    return "–" if rows.is_empty() else cell(rows)
