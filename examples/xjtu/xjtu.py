"""Ball screws whose friction falls as their preload wears off: the trend, and when it will be too low.

    python examples/xjtu/xjtu.py [FILE] [--json] [--figure FILE] [--share 0.75] [--seed N]

The data set is public: XJTU Ball Screw Degradation Dataset, Xi'an Jiaotong University. FILE is a table with
the column `hours` and one `friction_torque_…` [N·m] for each screw, such as `friction_torque_upper`. Without
FILE, the folder named by the environment variable EMAPHM_DATA is searched, else `../shared/data` next to the
project. A share above 1 is a limit above the first torque, for friction that rises. See README.md.
"""

import argparse
import json
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl

from emaphm.arrays import Array
from emaphm.errors import EmaphmError, RecordingError
from emaphm.output_files import check_writable
from emaphm.prognosis import Question, Stress, StressPiece
from emaphm.prognosis.indicator import Indicator, IndicatorPrognosis, Reading, prognose_indicator
from emaphm.text_table import format_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HERE = Path(__file__).resolve().parent
DATA = Path(os.environ.get("EMAPHM_DATA", HERE.parents[2] / "shared" / "data"))
FILE = DATA / "xjtu" / "friction_torque.csv"

COLUMN = "friction_torque_"
"""A screw's column begins so, and ends with its name."""

FIRST_SPEED, SPEED_STEP, HOURS_A_SPEED = 300.0, 200.0, 140.0
"""Speed at first, its rise [rev/min], and after how many hours [h], as published."""

FEWEST = 8
"""Readings before the first forecast: two speeds' worth of them, to see how readings scatter."""

EVERY = 4
"""A forecast is made each time this number of readings is new: once a speed."""

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Trend:
    """A slope with half of its 95 % interval [N·m per 1,000 h]."""

    slope: float
    half: float

    @property
    def falls(self) -> bool:
        """Whether the whole interval is below 0."""
        return self.slope + self.half < 0

    @property
    def verdict(self) -> str:
        """What the interval says, in words."""
        return "falls" if self.falls else "rises" if self.slope - self.half > 0 else "cannot tell"


@dataclass(frozen=True)
class Screw:
    """A ball screw: its readings, trends, and forecasts from the past alone.

    `crossed` are the hours of the last reading above the limit after which one was below it, and of the
    first below it: the limit was passed between the earlier of both and the later; None while not reached.
    """

    name: str
    hours: Array
    torque: Array
    plain: Trend
    within_speeds: Trend
    by_revolutions: Trend
    limit: float
    crossed: tuple[float, float] | None
    forecasts: tuple[IndicatorPrognosis, ...]

    def holds(self, one: IndicatorPrognosis) -> bool | None:
        """Whether the 90 % interval meets the hours in which the limit was passed; None after them."""
        if self.crossed is None or one.indicator.hours >= self.crossed[0]:
            return None
        low, high = (one.indicator.hours + x for x in one.interval90)
        return low <= self.crossed[1] and high >= self.crossed[0]

    def to_dict(self) -> dict[str, Any]:
        """Return what --json prints of a screw."""
        trends = {
            "plain": self.plain,
            "within_speeds": self.within_speeds,
            "by_revolutions": self.by_revolutions,
        }
        return {
            "trends_Nm_per_1000h": {
                name: {"slope": one.slope, "half_width95": one.half, "falls": one.falls}
                for name, one in trends.items()
            },
            "limit_Nm": self.limit,
            "crossed_hours": self.crossed,
            "forecasts": [one.to_dict() | {"holds": self.holds(one)} for one in self.forecasts],
        }


def main() -> int:
    """Read, judge, print; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", type=Path, nargs="?", default=FILE, help="Friction torque by hours: .csv.")
    parser.add_argument("--share", type=float, default=0.75, help="Of the first torque, at which it fails.")
    parser.add_argument("--seed", type=int, default=0, help="Source of all randomness.")
    parser.add_argument("--json", action="store_true", help="Print one JSON object and nothing else.")
    parser.add_argument("--figure", type=Path, default=None, help="Where to draw: .svg, .png or .pdf.")
    arguments = parser.parse_args()
    try:
        if arguments.figure:
            check_writable(arguments.figure, force=True, endings=(".svg", ".png", ".pdf"))
        if not 0 < arguments.share < np.inf or arguments.share == 1:
            raise RecordingError(
                f"a share of {arguments.share:g}: give one between 0 and 1, or above 1 for a rise"
            )
        hours, torques = read(arguments.file)
        screws = [
            judge(name, hours, torque, arguments.share, arguments.seed) for name, torque in torques.items()
        ]
    except EmaphmError as error:
        print(f"xjtu: {error}", file=sys.stderr)
        return 2
    if arguments.figure:
        draw(screws).savefig(arguments.figure)
    print(json.dumps({one.name: one.to_dict() for one in screws}) if arguments.json else text(screws))
    return 0


def read(path: Path) -> tuple[Array, dict[str, Array]]:
    """Return hours and torques [N·m] by screw; `RecordingError` where the file is no such table."""
    try:
        frame = pl.read_csv(path)
        columns = [name for name in frame.columns if name.startswith(COLUMN) and name != COLUMN]
        missing = [] if "hours" in frame.columns else ["hours"]
        missing += [] if columns else [f"{COLUMN}…"]
        if missing:
            raise RecordingError(
                f"{path}: no column {', '.join(missing)} (the file has: {', '.join(frame.columns)}); give "
                "the table of friction torques"
            )
        table = frame.select(["hours", *columns]).cast(pl.Float64).to_numpy()
    except (OSError, pl.exceptions.PolarsError) as error:
        raise RecordingError(
            f"{path}: cannot be read ({str(error).splitlines()[0]}); give the table of friction torques"
        ) from None
    if len(table) <= FEWEST or not np.all(np.isfinite(table)) or not np.all(np.diff(table[:, 0]) > 0):
        raise RecordingError(f"{path}: give more than {FEWEST} rows of numbers, by rising hours")
    hours = table[:, 0]
    if hours[0] < 0:
        raise RecordingError(f"{path}: hours from {hours[0]:g}; count them from 0, when the screws were new")
    if hours[0] > 0:
        note = "the speeds follow from hours since new, and the limit is a share of the first torque given"
        print(f"xjtu: {path}: hours begin at {hours[0]:g}; {note}", file=sys.stderr)
    speeds = np.unique(speed_number(hours)).size
    if len(hours) < 2 * speeds:
        raise RecordingError(
            f"{path}: {len(hours)} readings at {speeds} speeds, less than two a speed; give hours: a speed "
            f"lasts {HOURS_A_SPEED:g} of them"
        )
    return hours, {name.removeprefix(COLUMN): table[:, i + 1] for i, name in enumerate(columns)}


def speed_number(hours: Array) -> Array:
    """Return which speed, from 0, the screw had run at when it was measured at those hours.

    The screws are taken out and measured after the hours at a speed, so a reading at a change of speed
    belongs to the speed before it.
    """
    return np.asarray(np.maximum(np.ceil(hours / HOURS_A_SPEED) - 1, 0.0))


def speed(hours: float) -> float:
    """Return the speed [rev/min] that was run up to those hours."""
    return FIRST_SPEED + SPEED_STEP * float(speed_number(np.array([hours]))[0])


def revolutions(hours: Array) -> Array:
    """Return the revolutions since new, as hours at the mean speed of all hours [h]."""
    grid = np.linspace(0.0, hours[-1], 20_001)
    speeds = FIRST_SPEED + SPEED_STEP * speed_number(grid[1:])
    turned = np.concatenate([[0.0], np.cumsum(speeds) * (grid[1] - grid[0])])
    return np.asarray(np.interp(hours, grid, turned) * hours[-1] / turned[-1])


def trend(clock: Array, torque: Array, offsets: Array) -> Trend:
    """Return the slope of torque over `clock` [h], each number of `offsets` (n,) with its own offset."""
    from scipy.stats import t as student

    columns = (offsets[:, np.newaxis] == np.unique(offsets)).astype(float)
    x = np.column_stack([clock / 1000, columns])
    solved, *_ = np.linalg.lstsq(x, torque, rcond=None)
    free = len(torque) - x.shape[1]
    variance = float(np.sum((torque - x @ solved) ** 2) / free)
    error = np.sqrt(variance * np.linalg.inv(x.T @ x)[0, 0])
    return Trend(float(solved[0]), float(error * student.ppf((1 + CONFIDENCE) / 2, free)))


def judge(name: str, hours: Array, torque: Array, share: float, seed: int) -> Screw:
    """Return trends and forecasts of a screw that fails at a share of its first torque."""
    limit, alike = share * float(torque[0]), np.zeros(len(hours))
    ends = [*range(FEWEST, len(hours), EVERY), len(hours) - 1]
    return Screw(
        name,
        hours,
        torque,
        plain=trend(hours, torque, alike),
        within_speeds=trend(hours, torque, speed_number(hours)),
        by_revolutions=trend(revolutions(hours), torque, alike),
        limit=limit,
        crossed=crossing(hours, torque, limit) if share < 1 else crossing(hours, -torque, -limit),
        forecasts=tuple(forecast(name, hours[: i + 1], torque[: i + 1], limit, seed) for i in ends),
    )


def crossing(hours: Array, torque: Array, limit: float) -> tuple[float, float] | None:
    """Return the hours between which the torque fell to the limit, None where it never did."""
    below = np.flatnonzero(torque <= limit)
    if not below.size:
        return None
    above = np.flatnonzero(torque > limit)
    last = float(hours[above[-1]])
    # Readings scatter: the first below it may come before the last above it.
    return min(last, float(hours[max(below[0] - 1, 0)])), max(last, float(hours[below[0]]))


def forecast(name: str, hours: Array, torque: Array, limit: float, seed: int) -> IndicatorPrognosis:
    """Return when the torque comes to the limit, from these readings alone, at the speed of the last one.

    The error of a reading is the scatter about a straight line through them; speeds are the stress.
    """
    line = np.polyfit(hours, torque, 1)
    variance = float(np.sum((torque - np.polyval(line, hours)) ** 2) / (len(hours) - 2))
    starts = np.arange(0.0, hours[-1], HOURS_A_SPEED)
    pieces = tuple(
        StressPiece(
            float(start), float(min(start + HOURS_A_SPEED, hours[-1])), turning(speed(start + HOURS_A_SPEED))
        )
        for start in starts
    )
    indicator = Indicator(
        f"{name} screw",
        float(torque[0]),
        limit,
        tuple(Reading(float(h), float(x), variance) for h, x in zip(hours, torque, strict=True)),
        float(hours[-1]),
        "friction torque [N·m]",
        pieces,
    )
    return prognose_indicator(indicator, Question(ahead=turning(speed(float(hours[-1])))), seed=seed)


def turning(rpm: float) -> Stress:
    """Return a speed [rev/min] as stress: a revolution is a cycle."""
    return Stress(cycles_per_hour=60 * rpm)


def text(screws: list[Screw]) -> str:
    """Return trends and forecasts as tables."""
    lines = []
    for one in screws:
        lines.append(
            f"{one.name} screw: {one.torque[0]:.3f} N·m at {one.hours[0]:g} h, {one.torque[-1]:.3f} at "
            f"{one.hours[-1]:g} h"
        )
        rows = [
            (what, f"{found.slope:+.3f} ± {found.half:.3f}", found.verdict)
            for what, found in (
                ("over hours", one.plain),
                ("over hours, an offset for each speed", one.within_speeds),
                ("over revolutions", one.by_revolutions),
            )
        ]
        lines += [format_table(("trend", "N·m per 1,000 h, 95 %", ""), rows), ""]
        passed = (
            "not reached" if one.crossed is None else "passed between {:g} and {:g} h".format(*one.crossed)
        )
        lines.append(f"limit {one.limit:.3f} N·m: {passed}")
        header = ("at [h]", "passes it at [h]", "90 %", "held", "most likely law", "exponent of the speed")
        lines.append(format_table(header, [_row(one, made) for made in one.forecasts]))
        lines += [*(f"note: {note}" for note in one.forecasts[-1].notes), ""]
    return "\n".join(lines).rstrip()


def _row(screw: Screw, made: IndicatorPrognosis) -> tuple[str, ...]:
    now = made.indicator.hours
    low, high = made.interval90
    law = max(made.laws, key=made.laws.__getitem__)
    exponent = made.to_dict()["stress"]["exponents"]["cycles"]
    return (
        f"{now:g}",
        "passed" if made.median == 0 else _hours(now + made.median),
        f"{_hours(now + low)} to {_hours(now + high)}",
        {None: "", True: "yes", False: "no"}[screw.holds(made)],
        f"{law} ({100 * made.laws[law]:.0f} %)",
        "{:.2f} ({:.2f} to {:.2f})".format(exponent["median"], *exponent["interval90"]),
    )


def _hours(hours: float) -> str:
    return f"{hours:,.0f}" if np.isfinite(hours) else "not in sight"


def draw(screws: list[Screw]) -> "Figure":
    """Draw each screw's torque, the limit, and the forecasts of when it is reached."""
    from emaphm.plotting.style import (
        BLUE,
        FAINT,
        PAGE_WIDTH,
        VERMILION,
        legend_beside_title,
        new_figure,
        style_axis,
    )

    figure = new_figure(PAGE_WIDTH, 6.4)
    axes = figure.subplots(2, len(screws), height_ratios=(1.2, 1), sharex=True, squeeze=False)
    for column, one in zip(axes.T, screws, strict=True):
        above, below = column
        above.plot(one.hours, one.torque, "o", color=BLUE, markersize=3.5, label="reading")
        above.axhline(one.limit, color=VERMILION, linestyle="--", linewidth=1, label="limit")
        for change in np.arange(HOURS_A_SPEED, one.hours[-1], HOURS_A_SPEED):
            above.axvline(change, color=FAINT, linestyle=":", linewidth=0.6)
        style_axis(above, f"{one.name} screw", "", "friction torque [N·m]")
        legend_beside_title(above)
        top = 2.5 * one.hours[-1]
        for k, made in enumerate(one.forecasts):
            now = made.indicator.hours
            low, high = (min(now + x, top) for x in made.interval90)
            ends = [now, now]
            below.plot(
                ends,
                [low, high],
                color=BLUE,
                linewidth=5,
                alpha=0.35,
                solid_capstyle="butt",
                label="" if k else "90 %",
            )
            below.plot(
                now, min(now + made.median, top), "o", color=BLUE, markersize=4, label="" if k else "median"
            )
        if one.crossed is not None:
            below.axhspan(*one.crossed, color=VERMILION, alpha=0.25, linewidth=0, label="passed")
        below.set_ylim(0, 1.03 * top)
        style_axis(below, "forecast", "at [h]", f"passes the limit at [h], at most {top:,.0f}")
        legend_beside_title(below, columns=3)
    return figure


if __name__ == "__main__":
    sys.exit(main())
