"""The pages of studies that vary one thing about the base setting: limits, plants, loads, data sheets."""

from collections.abc import Iterator, Mapping

import polars as pl

from emaphm.actuator import COMPONENTS
from emaphm.errors import StudyError
from emaphm.plotting.limits import draw_limits
from emaphm.plotting.svg import plain_style, svg
from emaphm.report.markdown import incomplete, mixed
from emaphm.study.analysis.limits import SettingRates
from emaphm.study.analysis.rates import least_by_chance, single_fault
from emaphm.study.plan import PageRow, PageSection, Plan
from emaphm.text_table import markdown_table

HEADER = (
    "error: median / 95th percentile, %",
    "coverage: mean",
    "least",
    "explained",
    "small faults detected",
    "false alarms",
)

TITLES = {
    "limits": "Accuracy as the rig gets worse",
    "plants": "Plants that are not as described",
    "loads": "Loads that vary",
    "data_sheets": "A unit and its data sheet",
}
"""What the pages of this form are called."""

Rates = Mapping[PageRow, SettingRates]


def limits_page(plan: Plan, runs: pl.DataFrame, folder: str) -> tuple[str, dict[str, bytes]]:
    """Return the page as Markdown, and its figures as SVG by name; the page links to them in `folder`.

    `runs` are the finished trials of `plan`.

    Raises
    ------
    StudyError
        The plan has no rigs or sections, or a row of the page has no finished trial.
    """
    if not (plan.sections and plan.rigs):
        raise StudyError("page 'limits' needs [[rigs]] and [[sections]] in its plan; add them")
    rates = {row: SettingRates.of(row, runs) for section in plan.sections for row in section.rows}
    base = _base(plan)
    lines = [
        f"# {TITLES[plan.page or 'limits']}\n",
        *incomplete(runs.height, plan.total),
        *mixed(runs["revision"].to_list()),
        *_introduction(plan, runs, base, rates),
        "## Overconfident settings\n",
        *_overconfident(plan, rates),
    ]
    figures = {}
    for section in plan.sections:
        lines.append(f"\n## {section.title}\n")
        if section.note:
            lines.append(section.note + "\n")
        if section.figure:
            with plain_style():
                figures[section.figure] = svg(draw_limits(section, rates))
            lines.append(f"![{section.title.lower()}]({folder}/{section.figure}.svg)\n")
            lines.append(_reading(section, rates) + "\n")
        lines.append(_table(section, rates))
    return "\n".join(lines) + "\n", figures


def _base(plan: Plan) -> PageRow:
    """Return a row of the first rig and the first method, which all others are compared with."""
    rig, method = plan.rigs[0].label, plan.methods[0].label
    for section in plan.sections:
        for row in section.rows:
            if (row.rig, row.method) == (rig, method):
                return row
    raise StudyError(f"no section has a row of rig '{rig}' by method '{method}', the base setting; add one")


def _introduction(plan: Plan, runs: pl.DataFrame, base: PageRow, rates: Rates) -> Iterator[str]:
    rig, m = plan.rigs[0], plan.manoeuvre
    yield (
        f"Made by `make study`, from the plan `{plan.name}`. The base setting is that of "
        f"[accuracy.md](accuracy.md): {rig.noise:g} A of noise, {rig.adc_bits}-bit converters, an unknown "
        f"load within ±{rig.load[1]:g} N·m, windings at an unknown temperature within ±{rig.heat[1]:g} K of "
        "nominal, current and line voltage recorded, a "
        f"{m.duration:g} s chirp at {m.sample_rate / 1e3:g} kHz. Each setting differs from it in one "
        "respect; all settings have the same faults, loads and temperatures. By default, load, temperature "
        "and deviations from the description that a recording shows are estimated with the faults.\n"
    )
    mine = runs.filter(pl.col("rig") == base.rig, pl.col("method") == base.method)
    small, healthy = (mine.filter(pl.col("case_kind") == kind) for kind in ("small", "healthy"))
    size = single_fault(small["truth"][0].to_list())[1]
    count = rates[base].cases
    components = (len(COMPONENTS) - 1) * small.height + len(COMPONENTS) * healthy.height
    yield (
        f"In each setting, {count} recordings with random faults give the error, the coverage of the 95 % "
        "intervals (the mean over the components, and the least with its component) and the share of "
        f"explained recordings. {small.height} recordings with a single fault of {100 * size:.0f} % and "
        f"{healthy.height} healthy recordings give the share of these small faults that were called "
        f"degraded, and the share of false alarms among {components} healthy components. These numbers of "
        "cases show where the diagnosis fails, not differences of some percent: with true 95 % intervals, "
        f"the coverage of a component would be below {100 * least_by_chance(count):.0f} % in one setting of "
        "a thousand.\n"
    )


def _overconfident(plan: Plan, rates: Rates) -> Iterator[str]:
    """Yield the settings whose intervals are too narrow though the recordings are called explained."""
    named: dict[tuple[str, str], tuple[str, SettingRates]] = {}
    for section in plan.sections:
        several = len({row.method for row in section.rows}) > 1
        for row in section.rows:
            name = f"{section.label}: {row.text}{f', {row.method}' if several else ''}"
            named.setdefault((row.rig, row.method), (name, rates[row]))
    found = [(name, one) for name, one in named.values() if one.overconfident]
    yield (
        "Settings in which the interval of a component contains the truth less often than chance allows, "
        "although more than half of the recordings are called explained: "
        + (f"{len(found)} of {len(named)}.\n" if found else f"none of {len(named)}.")
    )
    for name, one in found:
        yield (
            f"- {name}: the 95 % interval of {one.least_covered} contains the truth in "
            f"{100 * one.least_coverage:.0f} % of the cases, {100 * one.explained:.0f} % of the recordings "
            f"are explained, median error {one.median:.2f} %"
        )


def _reading(section: PageSection, rates: Rates) -> str:
    """Return what a section does to the median error, and what estimating more changes about it."""
    first = section.rows[0].method
    by_default = {row.text: rates[row].median for row in section.rows if row.method == first}
    least, largest = (pick(by_default, key=by_default.__getitem__) for pick in (min, max))
    sentence = (
        f"For {section.label}, the median error is smallest at {least} ({by_default[least]:.2f} %) and "
        f"largest at {largest} ({by_default[largest]:.2f} %)"
    )
    for method in dict.fromkeys(row.method for row in section.rows if row.method != first):
        changes = ", ".join(
            f"{by_default[row.text]:.2f} to {rates[row].median:.2f} % at {row.text}"
            for row in section.rows
            if row.method == method
        )
        sentence += f"; with {method} it changes from {changes}"
    return sentence + "."


def _table(section: PageSection, rates: Rates) -> str:
    several = len({row.method for row in section.rows}) > 1
    rows = [[row.text, *([row.method] if several else []), *_cells(rates[row])] for row in section.rows]
    return markdown_table([section.label, *(["estimated"] if several else []), *HEADER], rows)


def _cells(rates: SettingRates) -> list[str]:
    """Return the cells of a table, in the order of `HEADER`."""
    weakest = f" ({rates.least_covered})" if rates.least_coverage < 1 else ""
    return [
        f"{rates.median:.2f} / {rates.p95:.2f}",
        f"{100 * rates.mean_coverage:.0f} %",
        f"{100 * rates.least_coverage:.0f} %{weakest}",
        f"{100 * rates.explained:.0f} %",
        f"{100 * rates.detection:.0f} %",
        f"{100 * rates.false_alarms:.1f} %",
    ]
