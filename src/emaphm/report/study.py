"""The report of a study from its finished runs: Markdown, CSV and one HTML page."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import polars as pl

from emaphm.output_files import make_folder, written_whole
from emaphm.plotting.study import draw_convergence, draw_costs, draw_errors, draw_ranks, draw_success
from emaphm.plotting.svg import plain_style, svg
from emaphm.report.document import Block, Document, Facts, Heading, Items, Paragraph, Picture
from emaphm.report.markdown import mixed_revisions
from emaphm.report.study_wording import (
    CONVERGENCE,
    COSTS,
    ERROR,
    ERRORS,
    HOLLOW,
    HOPELESS,
    INTERVAL,
    PAIRS,
    RANK,
    RANKS,
    RELIABILITY,
    RELIABILITY_THESIS,
    SUCCESS,
    THESIS,
    TIME,
    TIME_THESIS,
)
from emaphm.report.wording import FITNESS_UNITS
from emaphm.study.analysis.ranks import FEWEST_BLOCKS, SIGNIFICANT, friedman, mean_ranks, pairs
from emaphm.study.analysis.statistics import (
    LIMITS_PERCENT,
    VARIANT,
    by_case,
    by_method,
    comparable,
    prepared,
    reliability,
)
from emaphm.study.analysis.tables import (
    MOST_CASES,
    error_table,
    p_value,
    pair_table,
    rank_table,
    reliability_table,
    success_table,
    summary_table,
    time_table,
    variant_names,
    variant_table,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SUBTITLE = "Comparison of methods of fault identification"


def write_study_report(
    runs: pl.DataFrame,
    title: str,
    description: str,
    folder: str | Path,
    total_runs: int,
    environment: Mapping[str, str],
) -> list[Path]:
    """Write report.md, report.html, figures/*.svg and tables/*.csv to `folder`; return their paths.

    Files of an earlier report are replaced, each atomically. The same runs give the same bytes.

    Parameters
    ----------
    runs
        The finished runs (`emaphm.study.store.SCHEMA`); the study may be incomplete.
    title, description
        Name of the study, and the question that it answers.
    total_runs
        Number of runs of the complete study.
    environment
        Machine, versions and similar facts about the runs, by name.

    Raises
    ------
    OutputError
        The folder or a file in it cannot be written.
    """
    folder = Path(folder)
    with plain_style():
        document = _document(runs, title, description, total_runs, environment)
    contents = {
        **{f"figures/{picture.name}": picture.svg for picture in document.pictures},
        **{f"tables/{name}.csv": frame.write_csv().encode() for name, frame in tables(runs).items()},
        # Names in a plan may be invalid text: characters that cannot be encoded become question marks.
        "report.md": document.to_markdown().encode(errors="replace"),
        "report.html": document.to_html().encode(errors="replace"),
    }
    paths = []
    for name, content in contents.items():
        path = folder / name
        make_folder(path.parent)
        with written_whole(path) as temporary:
            temporary.write_bytes(content)
        paths.append(path)
    return paths


def tables(runs: pl.DataFrame) -> dict[str, pl.DataFrame]:
    """Return the content of the CSV files by name: the unrounded numbers of the report, and the runs."""
    cases, methods = by_case(runs), by_method(runs)
    identity = (*VARIANT, "kind", "method")
    success = [f"within_{limit}" for limit in LIMITS_PERCENT]
    times = ("seconds", "mean_seconds")
    without_lists = [name for name, kind in runs.schema.items() if not isinstance(kind, pl.List)]
    return {
        "errors": cases.drop(*success, *times, "thesis_seconds", "evaluations", "reference_runs"),
        "times": cases.select(*VARIANT, "kind", "case", "method", "runs", *times, "thesis_seconds"),
        "summary": methods.drop(success),
        "success": methods.select(*identity, "cases", "runs", *success),
        "ranks": mean_ranks(runs),
        "friedman": friedman(runs),
        "pairs": pairs(runs),
        "reliability": reliability(runs),
        "runs": runs.sort("index").select(without_lists),
    }


def _document(
    runs: pl.DataFrame, title: str, description: str, total_runs: int, environment: Mapping[str, str]
) -> Document:
    blocks: list[Block] = [Paragraph(description)] if description else []
    blocks += _extent(runs, total_runs)
    names = variant_names(runs)
    if len(names) > 1:
        blocks += _variant_comparison(runs)
    for number, (variant, name) in enumerate(names.items(), 1):
        of_variant = runs.filter(
            pl.all_horizontal(pl.col(key) == value for key, value in zip(VARIANT, variant, strict=True))
        )
        several = len(names) > 1
        blocks += [Heading(2, _capital(name))] if several else [Paragraph(f"All runs: {name}.")]
        blocks += _variant(of_variant, f"-{number}" if several else "", 3 if several else 2)
    blocks += [
        Heading(2, "How to read this report"),
        Items((ERROR, INTERVAL, RANK, *((THESIS,) if _is_printed(runs) else ()))),
    ]
    blocks += [Heading(2, "How this was computed"), Facts({**environment, **_origin(runs, total_runs)})]
    return Document(title, SUBTITLE, tuple(blocks))


def _extent(runs: pl.DataFrame, total_runs: int) -> Iterator[Block]:
    counts = f"methods: {runs['method'].n_unique()}, cases: {runs['case'].n_unique()}"
    if runs.is_empty():
        yield Paragraph(f"0 of {total_runs} runs are finished: there are no results yet.", warning=True)
    elif runs.height < total_runs:
        yield Paragraph(
            f"The study is not complete: {runs.height} of {total_runs} runs are finished ({counts}). "
            "All results below are of these runs and may change.",
            warning=True,
        )
    else:
        yield Paragraph(f"{runs.height} of {total_runs} runs are finished; {counts}.")
    several = mixed_revisions(runs["revision"].to_list())
    if several:
        yield Paragraph(several, warning=True)


def _variant_comparison(runs: pl.DataFrame) -> Iterator[Block]:
    yield Heading(2, "Comparison of the variants")
    for kind in _case_kinds(runs):
        table = variant_table(runs, kind)
        if table.rows:
            yield Paragraph(
                f"Mean error in % over the runs with {kind} that every method has finished in every variant."
            )
            yield table
        else:
            yield Paragraph(f"No run with {kind} is finished by every method in every variant yet.")


def _variant(runs: pl.DataFrame, suffix: str, level: int) -> Iterator[Block]:
    """Yield the results of one variant; the file names of its figures end in `suffix`."""

    def picture(name: str, words: str, figure: "Figure | None", caption: str) -> Iterator[Block]:
        if figure is not None:
            yield Picture(f"{name}{suffix}.svg", words, caption, svg(figure))

    hollow = HOLLOW if _is_printed(runs) else ""
    yield Heading(level, "Results")
    yield from _summaries(runs)
    yield from picture("costs", "Mean error against cost", draw_costs(runs), COSTS + hollow)
    yield Heading(level, "Error in each case")
    yield from _errors(runs)
    yield from picture("errors", "Error in each case", draw_errors(runs), ERRORS + hollow)
    success = success_table(runs)
    if success.rows:
        yield Heading(level, "Success rate")
        yield Paragraph("Percentage of runs with an error of at most 1, 2 and 5 %.")
        yield success
        yield from picture("success", "Percentage of runs that succeed", draw_success(runs), SUCCESS)
    curves = draw_convergence(runs, FITNESS_UNITS.get(runs["fitness"][0], "arbitrary unit"))
    if curves is not None:
        yield Heading(level, "Convergence")
    yield from picture("convergence", "Best error and fitness against evaluations", curves, CONVERGENCE)
    yield Heading(level, "Time of a run")
    yield Paragraph(TIME + (TIME_THESIS if _is_printed(runs) else ""))
    yield time_table(runs)
    coefficients = reliability_table(runs)
    if coefficients.rows:
        yield Heading(level, "Reliability coefficient of the thesis")
        yield Paragraph(RELIABILITY + (RELIABILITY_THESIS if _is_printed(runs) else ""))
        yield coefficients
    if runs["method"].n_unique() > 1:
        yield Heading(level, "Are the differences significant?")
        yield Paragraph(_friedman(runs))
        yield rank_table(runs)
        yield from picture("ranks", "Mean ranks", draw_ranks(runs), RANKS)
        yield Paragraph(PAIRS + ("" if _could_differ(runs) else HOPELESS))
        yield pair_table(runs)


def _summaries(runs: pl.DataFrame) -> Iterator[Block]:
    common = comparable(runs)
    if common.height < runs.height:
        kept = set(common["case"])
        cases = runs.sort("index")["case"].unique(maintain_order=True)
        left_out = [case for case in cases if case not in kept]
        whole_cases = f", and with them all of {_listed(left_out)}" if left_out else ""
        yield Paragraph(
            f"Not every method has the same runs. The averages leave out {runs.height - common.height} of "
            f"{runs.height} runs whose case and seed a method lacks{whole_cases}, so that all methods are "
            "compared on the same recordings; the tables and figures by case have all runs.",
            warning=True,
        )
    for kind in _case_kinds(runs):
        table = summary_table(runs, kind)
        if table.rows:
            yield Paragraph(f"Cases with {kind}, least mean error first.")
            yield table


def _errors(runs: pl.DataFrame) -> Iterator[Block]:
    cases = runs["case"].n_unique()
    extent = (
        f" The first {MOST_CASES} of {cases} cases; tables/errors.csv has all." if cases > MOST_CASES else ""
    )
    thesis = "; this study / thesis where the thesis prints a value" if _is_printed(runs) else ""
    yield Paragraph(f"Mean error in % over the runs of a case{thesis}.{extent}")
    yield error_table(runs)


def _is_printed(runs: pl.DataFrame) -> bool:
    """Return whether the thesis prints an error for any of these cases and methods."""
    return by_case(runs)["thesis"].count() > 0


def _friedman(runs: pl.DataFrame) -> str:
    """Return the result of Friedman's test for one variant, in words."""
    test = friedman(runs).row(0, named=True)
    left_out = f" {test['incomplete']} further pairs lack a method." if test["incomplete"] else ""
    basis = f"All methods have finished {test['blocks']} pairs of case and seed.{left_out}"
    if test["p"] is None:
        lacking = "three methods" if test["methods"] < 3 else f"{FEWEST_BLOCKS} such pairs"
        return f"{basis} This is not enough for Friedman's test, which needs {lacking} or more."
    verdict = "differ significantly" if test["p"] <= SIGNIFICANT else "do not differ significantly"
    p = p_value(test["p"])
    relation = "p < 0.001" if p.startswith("<") else f"p = {p}"
    return (
        f"{basis} By their ranks within each, the methods {verdict} (Friedman's test: "
        f"χ² = {test['statistic']:.1f}, {relation})."
    )


def _origin(runs: pl.DataFrame, total_runs: int) -> dict[str, str]:
    revisions, versions = (", ".join(sorted(set(runs[name]))) for name in ("revision", "version"))
    return {
        "Runs": f"{runs.height} of {total_runs}",
        "Version": f"emaphm {versions}",
        "Revision of the models": revisions,
    }


def _case_kinds(runs: pl.DataFrame) -> list[str]:
    return prepared(runs)["kind"].unique(maintain_order=True).to_list()


def _could_differ(runs: pl.DataFrame) -> bool:
    """Return whether any pair has enough runs for a significant difference if one method wins all of them."""
    tests = pairs(runs).drop_nulls("p")
    return any(tests.height * 2 / 2.0**blocks <= SIGNIFICANT for blocks in tests["blocks"])


def _listed(names: Sequence[str]) -> str:
    most = 8
    more = f" and {len(names) - most} more cases" if len(names) > most else ""
    return ", ".join(f"\u2018{name}\u2019" for name in names[:most]) + more


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
