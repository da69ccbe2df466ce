"""The page of the study `accuracy`: what was asked of the diagnosis and what it reached."""

from collections.abc import Iterator

import numpy as np
import polars as pl

from emaphm.actuator import COMPONENTS, NAMES
from emaphm.errors import StudyError
from emaphm.experiment.test_setup import LARGEST_SHORT
from emaphm.report.markdown import incomplete, mixed, percent
from emaphm.study.analysis.rates import (
    alarms,
    chance_interval,
    coverage,
    detection,
    errors,
    explained,
    false_alarms,
    half_widths,
    quantiles,
    recordings_alarmed,
    single_fault,
)
from emaphm.study.cases import HEAVY_SHORTS, SINGLE
from emaphm.study.plan import PageRow, PageSection, Plan
from emaphm.study.rig import Rig
from emaphm.study.thesis import published
from emaphm.text_table import markdown_table

MET = {True: "yes", False: "no", None: "–"}

NEAR_PERCENT = 2.0
"""Error that the thesis's multiple faults are to stay within."""

Line = tuple[str, str, str, bool | None]
"""What, asked, reached, met."""


class Results:
    """The trials of the study, by row of a page and kind of case."""

    def __init__(self, plan: Plan, runs: pl.DataFrame) -> None:
        self.plan = plan
        self.runs = runs
        if len(plan.sections) != 4:
            raise StudyError("page 'accuracy' needs the four [[sections]] of the built-in plan")
        self.described, self.multiple, self.heavy, self.base = plan.sections

    def of(self, row: PageRow, kind: str, size: float | None = None) -> pl.DataFrame:
        """Return the trials of a row, of small faults those of one `size`; none is an error."""
        chosen = self.have(row, kind)
        if size is not None:
            chosen = chosen.filter(pl.Series([single_fault(one)[1] == size for one in chosen["truth"]]))
        if chosen.is_empty():
            raise StudyError(f"no run of '{row.text}' with {kind} cases is finished; go on with the study")
        return chosen

    def have(self, row: PageRow, kind: str) -> pl.DataFrame:
        """Return the trials of a row, none where it has no such cases."""
        # The multiple-fault case has a group of its own, on a rig that others use as well.
        named = pl.col("case") == "multiple"
        named = named if kind == "multiple" else ~named
        return self.runs.filter(
            pl.col("rig") == row.rig,
            pl.col("method") == row.method,
            pl.col("case_kind") == ("named" if kind == "multiple" else kind),
            named,
        )

    def sizes(self, row: PageRow) -> list[float]:
        """Return the sizes of a row's small faults."""
        return sorted({single_fault(truth)[1] for truth in self.have(row, "small")["truth"]})

    def small(self, row: PageRow, size: float) -> dict[str, pl.DataFrame]:
        """Return the small faults of one size by kind."""
        rows = self.of(row, "small", size)
        kinds = pl.Series([single_fault(truth)[0] for truth in rows["truth"]])
        return {kind: rows.filter(kinds == kind) for kind in SINGLE if (kinds == kind).any()}

    def rig(self, row: PageRow) -> Rig:
        """Return the rig of a row."""
        return next(rig for rig in self.plan.rigs if rig.label == row.rig)


def accuracy_page(plan: Plan, runs: pl.DataFrame) -> str:
    """Return the page as Markdown; `runs` are the finished trials of `plan`.

    Raises
    ------
    StudyError
        The plan is not of this page, or a row of the page has no finished trial.
    """
    results = Results(plan, runs)
    m = plan.manoeuvre
    introduction = (
        f"Made by `make study`, from the plan `{plan.name}`. Recordings of '{plan.actuator.name}' by the "
        f"reference model, a {m.duration:g} s chirp at {m.sample_rate / 1e3:g} kHz; errors in percent as in "
        f"`emaphm.error_percent`. Random vectors have shorts up to {LARGEST_SHORT:g}, all other components "
        "anywhere in [0, 1]. Case n is drawn from seed n, as are its recording and its search. "
        "[limits.md](limits.md) shows what happens where one thing is worse than in the base setting.\n"
    )
    lines = [
        "# Accuracy of the diagnosis\n",
        *incomplete(runs.height, plan.total),
        *mixed(runs["revision"].to_list()),
        introduction,
        "## What was asked and what was reached\n",
        markdown_table(
            ["what", "asked", "reached", "met"],
            [[*line[:3], MET[line[3]]] for line in (*_without_noise(results), *_on_rig(results))],
        ),
        "",
        *_described(results),
        *_base(results),
    ]
    return "\n".join(lines) + "\n"


def _without_noise(results: Results) -> Iterator[Line]:
    row = results.described.rows[0]
    one, many = errors(results.of(row, "named")), errors(results.of(row, "random"))
    yield (
        f"{len(one)} single faults, noise-free: mean / worst",
        "≤ 0.3 / 0.8 %",
        f"{one.mean():.2f} / {one.max():.2f} %",
        bool(one.mean() <= 0.3 and one.max() <= 0.8),
    )
    middle, most = float(np.median(many)), float(np.percentile(many, 95))
    yield (
        f"{len(many)} random vectors, noise-free: median / 95th percentile",
        "≤ 0.5 / 2 %",
        f"{middle:.2f} / {most:.2f} %",
        middle <= 0.5 and most <= 2,
    )
    for row in results.multiple.rows:
        found = errors(results.of(row, "multiple"))
        yield (
            f"the thesis's multiple faults, {row.text}",
            f"≤ {NEAR_PERCENT:g} % in all",
            f"{_within(found)}, the worst {found.max():.2f} %",
            bool(found.max() <= NEAR_PERCENT),
        )


def _on_rig(results: Results) -> Iterator[Line]:
    main, alone = results.base.rows[:2]
    rows = results.of(main, "random")
    middle, most = float(np.median(errors(rows))), float(np.percentile(errors(rows), 95))
    yield (
        f"base setting, {main.text}, {rows.height} random vectors: median / 95th percentile",
        "≤ 2 / 6 %",
        f"{middle:.2f} / {most:.2f} %",
        middle <= 2 and most <= 6,
    )
    for row in (main, alone):
        rows = results.of(row, "random")
        shares = coverage(rows)
        low, high = int(np.argmin(shares)), int(np.argmax(shares))
        yield (
            f"base setting, {row.text}, {rows.height} random vectors: coverage of the 95 % intervals",
            "92 to 98 %, each component",
            f"{100 * shares[low]:.1f} % ({NAMES[low]}) to {100 * shares[high]:.1f} % ({NAMES[high]})",
            bool(shares[low] >= 0.92 and shares[high] <= 0.98),
        )
    healthy = results.of(main, "healthy")
    alarmed = false_alarms(healthy)
    yield (
        f"base setting, {main.text}, {healthy.height} healthy recordings: false alarms over all components",
        "≤ 0.5 %",
        f"{100 * alarmed:.2f} %",
        alarmed <= 0.005,
    )
    size = results.sizes(main)[0]
    small = results.small(main, size)
    yield (
        f"{min(rows.height for rows in small.values())} each of {100 * size:.0f} % faults, {main.text}",
        "detected, each with its rate",
        ", ".join(f"{kind} {100 * detection(rows):.0f} %" for kind, rows in small.items()),
        None,
    )


def _described(results: Results) -> Iterator[str]:
    section = results.described
    uncorrected = results.of(section.rows[-1], "random").height
    yield f"## {section.title}\n"
    yield (
        "The current alone is recorded, exactly or with noise; load and temperature are nominal and only the "
        f"faults are estimated. The thesis's best method has {min(published.ERROR.values()):.2f} % on the "
        f"ten single faults. Without bias correction, {uncorrected} of the random vectors.\n"
    )
    rows = []
    for row in section.rows:
        one = errors(results.of(row, "named"))
        rows.append(
            [row.text, f"{one.mean():.2f} / {one.max():.2f}", quantiles(errors(results.of(row, "random")))]
        )
    yield markdown_table(
        [
            section.label,
            "single faults: mean / worst, %",
            "random: median / 95th percentile / worst, %",
        ],
        rows,
    )
    yield from _multiple(results)
    yield from _heavy(results)


def _multiple(results: Results) -> Iterator[str]:
    disturbed = results.rig(results.multiple.rows[-1]).controller_noise
    yield (
        f"\nThe thesis's multiple faults ({published.MEAN_ERROR['multiple']['DA']} % there), ten times: one "
        "recording searched from ten seeds, and ten recordings whose switching differs by a noise on the "
        f"reference current of {disturbed:g} A, each searched from a seed of its own.\n"
    )
    rows = []
    for row in results.multiple.rows:
        found = errors(results.of(row, "multiple"))
        rows.append([row.text, ", ".join(f"{error:.2f}" for error in found), _within(found)])
    yield markdown_table([results.multiple.label, "error of each, %", f"at most {NEAR_PERCENT:g} %"], rows)


def _heavy(results: Results) -> Iterator[str]:
    low, high = HEAVY_SHORTS
    yield (
        f"\nShorts of {low:g} to {high:g} in all three phases, everything else anywhere: beyond what the "
        "averaged model is meant for, with the current at its limit most of the time. Some of these "
        "actuators are too weak to move; their diagnosis says so, and identifies next to nothing.\n"
    )
    rows = []
    for row in results.heavy.rows:
        every = results.of(row, "heavy")
        moved = every.filter(pl.col("moves"))
        found = errors(moved)
        wrong = moved.filter(pl.col("error_percent") > 5)
        rows.append(
            [
                row.text,
                f"{moved.height} of {every.height}",
                quantiles(found),
                f"{100 * np.mean(found <= 2):.0f} %",
                f"{100 * np.mean(found <= 5):.0f} %",
                f"{100 * min(coverage(moved)):.0f} %",
                f"{wrong['explained'].sum()} of {wrong.height}",
            ]
        )
    yield markdown_table(
        [
            results.heavy.label,
            "move",
            "error: median / 95th percentile / worst, %",
            "at most 2 %",
            "at most 5 %",
            "coverage: least",
            "of the others, called explained",
        ],
        rows,
    )


def _base(results: Results) -> Iterator[str]:
    section, m = results.base, results.plan.manoeuvre
    rig = results.rig(section.rows[0])
    random = {row.text: results.of(row, "random") for row in section.rows}
    chances = [
        f"{100 * low:.1f} to {100 * high:.1f} % of {count} cases"
        for count in sorted({rows.height for rows in random.values()}, reverse=True)
        for low, high in [chance_interval(count)]
    ]
    yield f"\n## {section.title}\n"
    yield (
        f"{rig.noise:g} A of noise on the current, all channels through {rig.adc_bits}-bit converters, a "
        f"load anywhere within ±{rig.load[1]:g} N·m and windings within ±{rig.heat[1]:g} K, neither "
        f"recorded; {m.duration:g} s at {m.sample_rate / 1e3:g} kHz. Load and temperature are estimated with "
        "the faults unless the row says otherwise. Faults as above. Times are wall times of a diagnosis, "
        "with as many side by side as there were workers.\n"
    )
    yield _errors(results, section)
    yield (
        "\nShare of the random cases whose 95 % interval holds the truth. Of a component whose intervals "
        f"are exactly right, chance shows {', '.join(chances)} nineteen times in twenty; more means that "
        "its intervals are wider than they need to be, less that they are too narrow:\n"
    )
    header = [section.label, *NAMES]
    yield markdown_table(
        header, [[name, *(f"{100 * one:.1f} %" for one in coverage(rows))] for name, rows in random.items()]
    )
    yield (
        "\nMedian half-width of these intervals, in the unit of the components (1 is the whole range). Two "
        "set-ups that cover equally often differ in this:\n"
    )
    yield markdown_table(
        header,
        [
            [name, *(f"{one:.4f}" for one in np.median(half_widths(rows), axis=0))]
            for name, rows in random.items()
        ],
    )
    yield (
        "\nHealthy recordings. A false alarm is a component called degraded; the phase of the eccentricity "
        "is not counted, it shares the verdict of the eccentricity itself.\n"
    )
    yield _healthy(results, section)
    yield (
        "\nSingle small faults, the rest healthy: how often the faulty component is called degraded, and how "
        "often any other is. Sizes are those of the component; a gain is that far from its healthy 0.5.\n"
    )
    yield _small(results, section)


def _errors(results: Results, section: PageSection) -> str:
    rows = []
    for row in section.rows:
        cases = results.of(row, "random")
        rows.append(
            [
                row.text,
                str(cases.height),
                quantiles(errors(cases)),
                percent(explained(cases)),
                f"{np.median(cases['seconds'].to_numpy()):.2f}",
            ]
        )
    return markdown_table(
        [
            section.label,
            "cases",
            "error: median / 95th percentile / worst, %",
            "explained",
            "median time, s",
        ],
        rows,
    )


def _healthy(results: Results, section: PageSection) -> str:
    rows = []
    for row in section.rows:
        cases = results.of(row, "healthy")
        rows.append(
            [
                row.text,
                str(cases.height),
                f"{100 * false_alarms(cases):.2f} %",
                f"{100 * recordings_alarmed(cases):.1f} %",
                _raised_by(cases),
                f"{100 * min(coverage(cases)):.1f} %",
                f"{100 * explained(cases):.1f} %",
                quantiles(errors(cases)),
            ]
        )
    return markdown_table(
        [
            section.label,
            "recordings",
            "false alarms, of components",
            "of recordings",
            "raised by",
            "coverage: least",
            "explained",
            "error: median / 95th percentile / worst, %",
        ],
        rows,
    )


def _raised_by(rows: pl.DataFrame) -> str:
    """Return which components raised how many alarms."""
    counts = alarms(rows).sum(axis=0)
    return ", ".join(f"{name} {n}" for name, n in zip(COMPONENTS, counts, strict=True) if n) or "none"


def _small(results: Results, section: PageSection) -> str:
    rows = []
    for row in section.rows:
        for size in results.sizes(row):
            small = results.small(row, size)
            rows.append(
                [
                    f"{row.text}, {100 * size:.0f} %",
                    str(min(cases.height for cases in small.values())),
                    *(f"{100 * detection(small[kind]):.0f} %" if kind in small else "–" for kind in SINGLE),
                    f"{100 * false_alarms(pl.concat(small.values())):.2f} %",
                ]
            )
    header = [f"{section.label}, size", "recordings each", *SINGLE, "others, called degraded"]
    return markdown_table(header, rows)


def _within(found: np.ndarray[tuple[int], np.dtype[np.float64]]) -> str:
    return f"{np.sum(found <= NEAR_PERCENT)} of {len(found)}"
