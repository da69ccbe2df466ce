"""A flight actuator run until it jammed: when its current shows it, and how long it was then said to last.

    python examples/reprise/reprise.py [FILE] [--json] [--figure FILE] [--frequency HZ] [--fails-at A]

The data set is public: REPRISE, University of Bergamo (Mazzoleni, Scandella, Previdi, Pispola, Data in Brief
29:105153, 2020). FILE is a table of features with the columns `date`, `condition`, `frequency_hz` and
`rms_A`, the phase current's RMS over one period of a sinusoid. Without FILE, the folder named by the
environment variable EMAPHM_DATA is searched, else `../shared/data` next to the project.

What is said of a test uses that test and those before it, never a later one. See README.md.
"""

import argparse
import json
import os
import sys
from dataclasses import dataclass
from datetime import date
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl

from emaphm.errors import EmaphmError, RecordingError
from emaphm.output_files import check_writable
from emaphm.prognosis import Question
from emaphm.prognosis.indicator import Indicator, IndicatorPrognosis, Reading, prognose_indicator
from emaphm.text_table import format_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HERE = Path(__file__).resolve().parent
DATA = Path(os.environ.get("EMAPHM_DATA", HERE.parents[2] / "shared" / "data"))
FILE = DATA / "reprise" / "phase_current_features_5mm.csv"

NEEDED = ("date", "condition", "frequency_hz", "rms_A")

HEALTHY = "normal"
"""Condition of the first tests, which say what healthy is: those up to the first of another condition."""

FEWEST_HEALTHY = 3
"""Of them: from two, the prediction bound of the alarm is 39 standard deviations wide."""

MOST_USUAL_A = 100.0
"""Median of all periods above which they are not in A: it is about 3 A, with at most 9 A in a period."""

EXCEEDED = 0.01
"""Share of a sinusoid's periods that exceed the most current the drive gives: those may be errors."""

MOST_PERIODS = 1.5
"""Of the usual number in a test; with more, two tests of a day have the same condition."""

FALSE_ALARM = 0.01
"""Probability that an ordinary test alarms."""

DRY = "no_lubricant"
"""Conditions of tests without lubricant begin so."""

DEAD_SENSOR = (date(2017, 9, 11), date(2017, 9, 25))
"""Phase A was not measured on these days and between them: their features are of phases B and C."""

PHASES_DIFFER = 0.05
"""Standard deviation, as a share, by which two phases may differ from three: chosen, nothing measures it."""

JAM = date(2017, 10, 13)
"""The jam came after this day, its date is not published: a RUL that ends before it is wrong."""

DAY = 24.0
APART = 6.0
"""Hours between two tests of one day; their times of day are not published."""

QUESTION = Question(horizon=3 * DAY)


@dataclass(frozen=True)
class Test:
    """A test: its `day`, hours since the first [h], and the median RMS current [A] of its periods."""

    day: date
    condition: str
    hours: float
    rms: float
    two_phases: bool


@dataclass(frozen=True)
class Judged:
    """A test by those up to it: the alarm's `bound` [A], and their `indicator`; None for the first tests.

    `seed` is that of the prognosis, which is made when it is asked for.
    """

    test: Test
    bound: float | None
    alarm: bool
    indicator: Indicator | None
    seed: int = 0

    @cached_property
    def prognosis(self) -> IndicatorPrognosis | None:
        """What is to be expected after the test; None for the first tests."""
        if self.indicator is None:
            return None
        return prognose_indicator(self.indicator, QUESTION, seed=self.seed)

    @property
    def to_jam(self) -> float | None:
        """Days from the test to the day after which the actuator jammed; None for a test after that."""
        return float((JAM - self.test.day).days) if self.test.day <= JAM else None

    @property
    def interval90(self) -> tuple[float, float] | None:
        """5 to 95 % of the RUL [days]."""
        if self.prognosis is None:
            return None
        low, high = self.prognosis.interval90
        return low / DAY, high / DAY

    @property
    def holds_jam(self) -> bool | None:
        """Whether the jam's day is in the 90 % interval."""
        if self.interval90 is None or self.to_jam is None:
            return None
        return self.interval90[0] <= self.to_jam <= self.interval90[1]


@dataclass(frozen=True)
class Run:
    """All tests, judged; `healthy` and `fails_at` [A], and the frequency [Hz] of what is looked at."""

    judged: tuple[Judged, ...]
    healthy: float
    fails_at: float
    frequency: float

    @property
    def monitored(self) -> tuple[Judged, ...]:
        """The tests after the baseline."""
        return tuple(one for one in self.judged if one.bound is not None)

    @property
    def dry_from(self) -> date | None:
        """The day of the first test without lubricant, None where there is none."""
        return next((one.test.day for one in self.judged if one.test.condition.startswith(DRY)), None)

    def dry(self, one: Judged) -> bool:
        """Whether a test is of the first day without lubricant, or later."""
        return self.dry_from is not None and one.test.day >= self.dry_from

    @property
    def false_alarms(self) -> int:
        """Alarms before the lubricant was gone."""
        return sum(one.alarm for one in self.monitored if not self.dry(one))

    @property
    def first_alarm(self) -> date | None:
        """The day of the first alarm without lubricant."""
        return next((one.test.day for one in self.monitored if one.alarm and self.dry(one)), None)

    def to_dict(self) -> dict[str, Any]:
        """Return what --json prints."""
        return {
            "frequency_hz": self.frequency,
            "healthy_A": self.healthy,
            "fails_at_A": self.fails_at,
            "first_alarm": None if self.first_alarm is None else self.first_alarm.isoformat(),
            "false_alarms": self.false_alarms,
            "monitored_before_dry": sum(not self.dry(one) for one in self.monitored),
            "jam_after": JAM.isoformat(),
            "tests": [_test_dict(one) for one in self.judged],
        }


def main() -> int:
    """Read, judge, print; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", type=Path, nargs="?", default=FILE, help="Features of the tests: .csv.")
    parser.add_argument("--frequency", type=float, default=1.0, help="Of the sinusoid looked at [Hz].")
    parser.add_argument("--fails-at", type=float, default=None, help="RMS current of a failed actuator [A].")
    parser.add_argument("--seed", type=int, default=0, help="Source of all randomness.")
    parser.add_argument("--json", action="store_true", help="Print one JSON object and nothing else.")
    parser.add_argument("--figure", type=Path, default=None, help="Where to draw: .svg, .png or .pdf.")
    arguments = parser.parse_args()
    try:
        if arguments.figure:
            check_writable(arguments.figure, force=True, endings=(".svg", ".png", ".pdf"))
        frame = read(arguments.file, arguments.frequency)
        run = judge(frame, arguments.frequency, arguments.fails_at, arguments.seed)
    except EmaphmError as error:
        print(f"reprise: {error}", file=sys.stderr)
        return 2
    if arguments.figure:
        draw(run).savefig(arguments.figure)
    print(json.dumps(run.to_dict()) if arguments.json else text(run))
    return 0


def read(path: Path, frequency: float = 1.0) -> pl.DataFrame:
    """Return the features of all tests, by day; `RecordingError` where the file is no such table.

    Periods of other frequencies [Hz] than that looked at may have no current: they are left out.
    """
    try:
        frame = pl.read_csv(path)
    except (OSError, pl.exceptions.PolarsError) as error:
        reason = str(error).splitlines()[0]
        raise RecordingError(
            f"{path}: cannot be read ({reason}); give the table of REPRISE's features"
        ) from None
    missing = [name for name in NEEDED if name not in frame.columns]
    if missing:
        raise RecordingError(f"{path}: no column {', '.join(missing)}; give the table of REPRISE's features")
    try:
        typed = frame.with_columns(
            pl.col("date").cast(pl.String).str.to_date("%Y-%m-%d"),
            pl.col("frequency_hz").cast(pl.Float64),
            pl.col("rms_A").cast(pl.Float64),
        )
    except pl.exceptions.PolarsError as error:
        raise RecordingError(f"{path}: {str(error).splitlines()[0]}; give dates as 2017-10-02") from None
    for name in NEEDED[:-1]:
        _check_filled(path, typed[name])
    usual = typed["rms_A"].median()
    if isinstance(usual, float) and usual > MOST_USUAL_A:
        raise RecordingError(
            f"{path}: the column rms_A has a median of {usual:,.0f}, too much for A of this actuator; divide "
            "it by 1,000 if it is in mA"
        )
    looked_at = typed["frequency_hz"] == frequency
    _check_filled(path, typed["rms_A"], looked_at)
    return typed.filter(looked_at | ~_empty(typed["rms_A"])).sort("date", maintain_order=True)


def _empty(column: pl.Series) -> pl.Series:
    empty = column.is_null()
    if column.dtype.is_float():
        empty = empty | ~column.is_finite().fill_null(value=False)
    return empty


def _check_filled(path: Path, column: pl.Series, rows: pl.Series | None = None) -> None:
    empty = _empty(column) if rows is None else _empty(column) & rows
    if empty.any():
        raise RecordingError(
            f"{path}: row {int(empty.arg_true()[0]) + 1} of column '{column.name}' is empty or not a finite "
            "number; correct it, or take the row out (rows count from 1, the header not included)"
        )


def tests_of(frame: pl.DataFrame, frequency: float) -> list[Test]:
    """Return the tests with a sinusoid of that frequency [Hz], in their order."""
    if frame.is_empty():
        raise RecordingError("the table has no rows; give the table of REPRISE's features")
    known = sorted(frame["frequency_hz"].unique().to_list())
    rows = frame.filter(pl.col("frequency_hz") == frequency)
    if rows.is_empty():
        raise RecordingError(
            f"no sinusoid of {frequency:g} Hz; there are {', '.join(f'{x:g}' for x in known)}"
        )
    found: list[Test] = []
    usual = float(np.median(rows.group_by("date", "condition").len()["len"].to_numpy()))
    for (day, condition), periods in rows.group_by("date", "condition", maintain_order=True):
        assert isinstance(day, date)  # noqa: S101 - for the type checker
        if len(periods) > MOST_PERIODS * usual:
            raise RecordingError(
                f"{day}: {len(periods)} periods of the condition '{condition}', where {usual:g} are usual; "
                "give two tests of a day different conditions"
            )
        rms = float(np.median(periods["rms_A"].to_numpy()))
        of_day = sum(one.day == day for one in found)
        first = found[0].day if found else day
        hours = DAY * (day - first).days + APART * of_day
        found.append(Test(day, str(condition), hours, rms, DEAD_SENSOR[0] <= day <= DEAD_SENSOR[1]))
    return found


def healthy_number(tests: list[Test]) -> int:
    """Return how many tests, the first ones, say what healthy is."""
    number = next((k for k, one in enumerate(tests) if one.condition != HEALTHY), len(tests))
    if number < FEWEST_HEALTHY or number == len(tests):
        raise RecordingError(
            f"{number} of {len(tests)} tests are of the condition '{HEALTHY}' first; give at least "
            f"{FEWEST_HEALTHY}, which say what is healthy, and a test after them"
        )
    return number


def judge(frame: pl.DataFrame, frequency: float = 1.0, fails_at: float | None = None, seed: int = 0) -> Run:
    """Return each test as it looks from it and those before it.

    An ordinary test is one that did not alarm. A test alarms above the one-sided prediction bound of the
    ordinary ones before it: their mean plus Student's t times their standard deviation times √(1 + 1/n).
    """
    from scipy.stats import t as student

    tests = tests_of(frame, frequency)
    first = healthy_number(tests)
    ordinary = [one.rms for one in tests[:first]]
    healthy = float(np.mean(ordinary))
    if fails_at is None:
        fails_at = most_current(frame, tests[first - 1].day, frequency)
    if not fails_at > healthy:
        raise RecordingError(
            f"it fails at {fails_at:g} A, where {healthy:.3g} A are healthy; give more with --fails-at"
        )
    judged = [Judged(one, None, alarm=False, indicator=None) for one in tests[:first]]
    for i in range(first, len(tests)):
        one, n = tests[i], len(ordinary)
        deviation = float(np.std(ordinary, ddof=1))
        of_one = np.hypot(deviation, PHASES_DIFFER * one.rms if one.two_phases else 0.0)
        bound = float(
            np.mean(ordinary) + student.ppf(1 - FALSE_ALARM, n - 1) * np.hypot(of_one, deviation / n**0.5)
        )
        alarm = one.rms > bound
        if not alarm:
            ordinary.append(one.rms)
        share = float(np.std(ordinary, ddof=1) / np.mean(ordinary))
        indicator = Indicator(
            "REPRISE",
            healthy,
            fails_at,
            tuple(reading(past, share) for past in tests[: i + 1]),
            one.hours,
            f"RMS current at {frequency:g} Hz [A]",
        )
        judged.append(Judged(one, bound, alarm, indicator, seed))
    return Run(tuple(judged), healthy, fails_at, frequency)


def most_current(frame: pl.DataFrame, until: date, frequency: float) -> float:
    """Return the most RMS current [A] of a period, of any frequency, on the days up to `until`.

    The most that the drive was seen to give when it was healthy: an actuator whose friction takes all of it
    in a slow motion has nothing left to move a load. Of a frequency, `EXCEEDED` of its periods have more.

    Raises
    ------
    RecordingError
        No sinusoid is faster than `frequency` [Hz]: how much the drive can give was not seen.
    """
    healthy = frame.filter(pl.col("date") <= until)
    if not (healthy["frequency_hz"] > frequency).any():
        raise RecordingError(
            f"no sinusoid above {frequency:g} Hz on the healthy days, to see the most that the drive gives; "
            "state the current at which it fails with --fails-at"
        )
    each = healthy.group_by("frequency_hz").agg(pl.col("rms_A").quantile(1 - EXCEEDED, "linear"))
    return float(np.max(each["rms_A"].to_numpy()))


def reading(test: Test, share: float) -> Reading:
    """Return a test as a reading; tests of the same health differ by `share` of their current."""
    error = np.hypot(share, PHASES_DIFFER if test.two_phases else 0.0) * test.rms
    return Reading(test.hours, test.rms, float(error**2))


def text(run: Run) -> str:
    """Return the tests as a table, and what they come to."""
    rows = []
    for one in run.judged:
        interval = one.interval90
        rows.append(
            (
                one.test.day.isoformat(),
                one.test.condition + (" (B, C)" if one.test.two_phases else ""),
                f"{one.test.rms:.2f}",
                "" if one.bound is None else f"{one.bound:.2f}",
                "ALARM" if one.alarm else "",
                "" if one.prognosis is None else _days(one.prognosis.median / DAY),
                "" if interval is None else f"{_days(interval[0])} to {_days(interval[1])}",
                "" if one.to_jam is None else f"{one.to_jam:.0f}",
                {None: "", True: "yes", False: "no"}[one.holds_jam],
            )
        )
    before = sum(not run.dry(one) for one in run.monitored)
    jam = f"; the actuator jammed after {JAM}" if run.judged[-1].to_jam is not None else ""
    dry = "no test without lubricant" if run.dry_from is None else str(run.first_alarm)
    header = ("day", "lubricant", "RMS [A]", "bound [A]", "", "RUL [days]", "90 %", "to 13 Oct", "held")
    return "\n".join(
        [
            format_table(header, rows),
            "",
            f"healthy {run.healthy:.2f} A, fails at {run.fails_at:.2f} A{jam}.",
            f"First alarm without lubricant: {dry}; before: {run.false_alarms} of {before}.",
        ]
    )


def draw(run: Run) -> "Figure":
    """Draw the current with its bound and limit, and the RUL with what was really left."""
    from emaphm.plotting.style import (
        BLUE,
        FAINT,
        PAGE_WIDTH,
        VERMILION,
        legend_beside_title,
        new_figure,
        style_axis,
    )

    figure = new_figure(PAGE_WIDTH, 6.2)
    current, rul = figure.subplots(2, 1)
    x = np.arange(len(run.judged))
    values = np.array([one.test.rms for one in run.judged])
    for mask, marker, label in (
        (np.array([not one.test.two_phases for one in run.judged]), "o", "test"),
        (np.array([one.test.two_phases for one in run.judged]), "s", "phases B and C"),
    ):
        current.plot(x[mask], values[mask], marker, color=BLUE, markersize=4, label=label)
    alarms = np.array([one.alarm for one in run.judged])
    current.plot(
        x[alarms], values[alarms], "o", color=VERMILION, markersize=9, fillstyle="none", label="alarm"
    )
    bounds = [np.nan if one.bound is None else one.bound for one in run.judged]
    current.plot(x, bounds, "_", color=FAINT, markersize=12, label="alarm bound")
    current.axhline(run.fails_at, color=VERMILION, linestyle="--", linewidth=1, label="fails")
    style_axis(current, f"RMS current at {run.frequency:g} Hz, grey: no lubricant", "", "A")
    legend_beside_title(current, columns=5)
    top = 60.0
    first = len(run.judged) - len(run.monitored)
    for k, one in zip(x, run.judged, strict=True):
        if one.prognosis is None or one.interval90 is None:
            continue
        low, high = (min(end, top) for end in one.interval90)
        rul.plot(
            [k, k],
            [low, high],
            color=BLUE,
            linewidth=5,
            alpha=0.35,
            solid_capstyle="butt",
            label="90 %" if k == first else "",
        )
        median = min(one.prognosis.median / DAY, top)
        rul.plot(k, median, "o", color=BLUE, markersize=4, label="median" if k == first else "")
    truth = [np.nan if one.to_jam is None else min(one.to_jam, top) for one in run.judged]
    rul.plot(x, truth, "k_", markersize=14, label="days to 13 October, after which it jammed")
    rul.set_ylim(-1, top * 1.03)
    style_axis(rul, "RUL, from the past alone", "", f"days, at most {top:.0f}")
    legend_beside_title(rul, columns=3)
    for axis in (current, rul):
        axis.set_xticks(x, [one.test.day.strftime("%d %b") for one in run.judged], rotation=45, ha="right")
        axis.set_xlim(-0.5, len(x) - 0.5)
        dry = next((k for k, one in zip(x, run.judged, strict=True) if run.dry(one)), None)
        if dry is not None:
            axis.axvspan(dry - 0.5, len(x) - 0.5, color="0.94", zorder=0)
    return figure


def _test_dict(one: Judged) -> dict[str, Any]:
    made = one.prognosis
    return {
        "date": one.test.day.isoformat(),
        "condition": one.test.condition,
        "two_phases": one.test.two_phases,
        "rms_A": one.test.rms,
        "bound_A": one.bound,
        "alarm": one.alarm,
        "days_to_jam_at_least": one.to_jam,
        "holds_jam": one.holds_jam,
        "prognosis": None if made is None else made.to_dict(),
    }


def _days(days: float) -> str:
    if not np.isfinite(days):
        return "not in sight"
    return f"{days:.1f}" if days < 10 else f"{days:.0f}"


if __name__ == "__main__":
    sys.exit(main())
