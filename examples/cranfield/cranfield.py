"""A ball-screw rig with seeded faults: a detector learned from healthy runs, and friction at each load.

    python examples/cranfield/cranfield.py --healthy FILE --judge FILE... [--json] [--figure FILE]

The data set is public: Ruiz-Carcel and Starr, "Data-based Detection and Diagnosis of Faults in Linear
Actuators", IEEE Transactions on Instrumentation and Measurement 67(9), 2018. Columns: `set_point` and
`position_error` [mm], `current` [A, without its sign], `profile`, `load` [kgf], `run`, `group` (a cycle),
`time` [s]. Every figure of the healthy file is of runs left out of what judges them.
"""

import argparse
import json
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from emaphm.actuator.parameters import FaultScales
from emaphm.detection import DETECTOR, Detector, DetectorResult, LeftOut, judged_left_out
from emaphm.detection.stroke_friction import HealthyFriction, StrokeCurrent, current_per_load
from emaphm.detection.thresholds import highest_rate
from emaphm.errors import EmaphmError, RecordingError
from emaphm.output_files import check_writable
from emaphm.plotting.detection import draw_detected_sets
from emaphm.recording import Recording
from emaphm.text_table import format_table

KGF = 9.80665
"""Newtons in the unit of the column `load`."""

NEEDED = ("set_point", "position_error", "current", "load", "run", "time")

CYCLE = ("profile", "load", "run", "cycle")

MOST_ROWS_OFF = 0.01
"""Largest relative difference in rows between cycles of a file."""

MOST_LINES = 5
"""Cycles left out of a file that are named one by one."""

Condition = tuple[str, float]
"""Profile and load [N]: friction differs between motions as well."""

Run = tuple[str, float, int]
"""Profile, load [N] and number of a run."""


@dataclass(frozen=True)
class Judged:
    """A set of runs: the detector's results, and the friction in each motion and at each load.

    `friction` [N] and `change` (value and half-width of the 95 % interval, relative to healthy) are by
    condition; `degraded` holds the fault components that are called so.
    """

    runs: list[DetectorResult]
    cycles: list[DetectorResult]
    friction: dict[Condition, float]
    change: dict[Condition, tuple[float, float]]
    load_share: dict[Condition, float]
    degraded: list[str]

    def summary(self) -> dict[str, Any]:
        """Return what --json prints of a set."""
        return {
            "runs_detected": detected(self.runs),
            "cycles_detected": detected(self.cycles),
            "conditions": [named(at) for at in sorted(self.friction)],
            "friction": [self.friction[at] for at in sorted(self.friction)],
            "degraded": self.degraded,
        }


def main() -> int:
    """Learn, judge, print; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--healthy", type=Path, required=True, help="Parquet of healthy runs.")
    parser.add_argument("--judge", type=Path, nargs="+", required=True, help="Parquet files to judge.")
    parser.add_argument("--json", action="store_true", help="Print one JSON object and nothing else.")
    parser.add_argument("--figure", type=Path, default=None, help="Where to draw: .svg, .png or .pdf.")
    arguments = parser.parse_args()
    figure = arguments.figure or Path("cranfield.svg")
    try:
        if not arguments.json:
            check_writable(figure, force=True, endings=(".svg", ".png", ".pdf"))
        healthy = read(arguments.healthy)
        # The healthy file itself is always judged, by runs left out.
        others = [path for path in arguments.judge if path.resolve() != arguments.healthy.resolve()]
        if len({path.stem for path in (arguments.healthy, *others)}) < 1 + len(others):
            raise RecordingError("two files have the same name; rename one, as names tell sets apart")
        sets = {path.stem: read(path) for path in others}
        judged, left_out = judge_all(arguments.healthy.stem, healthy, sets)
    except EmaphmError as error:
        say(str(error))
        return 2
    if arguments.json:
        print(json.dumps(summary(judged, left_out)))
        return 0
    print(table(judged, left_out, arguments.healthy.stem))
    draw_detected_sets({name: one.runs for name, one in judged.items()}).savefig(figure)
    print(f"\nT² and Q of all runs drawn in {figure}")
    return 0


def read(path: Path) -> dict[Run, list[Recording]]:
    """Return the cycles of each run in a file, a recording each, in SI units."""
    try:
        frame = pl.read_parquet(path)
    except (OSError, pl.exceptions.PolarsError) as error:
        raise RecordingError(f"{path}: cannot be read as Parquet ({str(error).splitlines()[0]})") from None
    missing = [name for name in NEEDED if name not in frame.columns]
    if missing:
        raise RecordingError(f"{path}: no column {', '.join(missing)}; give a file of the Cranfield data set")
    if "profile" not in frame.columns:
        frame = frame.with_columns(profile=pl.lit("one"))
    frame = frame.with_columns(pl.col("load").cast(pl.Float64), cycle=cycle_numbers(frame))
    runs: dict[Run, list[Recording]] = {}
    usual = usual_rows(frame)
    left_out = []
    for (profile, load, run, cycle), rows in frame.group_by(CYCLE, maintain_order=True):
        source = f"{path.name}, load {load:g} kgf, run {run}, cycle {cycle}"
        try:
            recording = recording_of(rows, load * KGF, source)
        except RecordingError as error:
            left_out.append(f"{error}; left out")
            continue
        others = usual[str(profile)]
        if abs(recording.samples - others) > MOST_ROWS_OFF * others:
            left_out.append(f"{source}: {recording.samples} rows, others have {others}; left out")
            continue
        runs.setdefault((str(profile), load * KGF, int(run)), []).append(recording)
    say_left_out(path.name, left_out)
    if not runs:
        raise RecordingError(f"{path}: no cycle of it can be read; see what is said of each")
    return runs


def usual_rows(frame: pl.DataFrame) -> dict[str, int]:
    """Return how many rows most cycles of each profile have."""
    return {
        str(profile): int(np.bincount(rows.group_by("cycle").len()["len"].to_numpy()).argmax())
        for (profile,), rows in frame.group_by("profile")
    }


def cycle_numbers(frame: pl.DataFrame) -> pl.Expr:
    """Return each row's cycle: one begins where time starts again, or run or load changes."""
    begins = pl.col("time").diff() < 0
    for name in ("run", "load", "profile", "group"):
        if name in frame.columns:
            begins = begins | (pl.col(name) != pl.col(name).shift())
    return begins.fill_null(value=False).cum_sum()


def recording_of(rows: pl.DataFrame, load: float, source: str) -> Recording:
    """Return a cycle in SI units, at a load [N]."""
    command = rows["set_point"].to_numpy() * 1e-3
    columns = {
        "time_s": rows["time"].to_numpy(),
        "command_rad": command,  # [m]: the actuator is linear
        "position_rad": command - rows["position_error"].to_numpy() * 1e-3,
        "current_A": rows["current"].to_numpy(),
        "load_Nm": np.full(command.size, load),  # [N]
    }
    return Recording(columns, "instant", source)


def say(text: str) -> None:
    """Print a line on stderr."""
    print(f"cranfield: {text}", file=sys.stderr)


def say_left_out(name: str, lines: list[str]) -> None:
    """Name the first cycles that were left out of a file, and count the others."""
    for line in lines[:MOST_LINES]:
        say(line)
    if len(lines) > MOST_LINES:
        say(f"{name}: {len(lines) - MOST_LINES} further cycles, for such reasons; left out")


def named(at: Condition) -> str:
    """Return a profile and a load in words."""
    return f"profile '{at[0]}' at {at[1] / KGF:g} kgf"


def judge_all(
    healthy_name: str, healthy: dict[Run, list[Recording]], sets: dict[str, dict[Run, list[Recording]]]
) -> tuple[dict[str, Judged], list[LeftOut]]:
    """Return each set as the healthy runs judge it, the healthy one first, by runs left out."""
    check_healthy(healthy_name, healthy)
    recordings = [one for cycles in healthy.values() for one in cycles]
    groups = [run for run, cycles in healthy.items() for _ in cycles]
    left_out = list(judged_left_out(recordings, groups))
    judged = {healthy_name: judge_healthy(healthy, left_out)}
    detector = Detector.learn(recordings, groups=groups)
    currents = stroke_currents(healthy)
    for name, runs in sets.items():
        judged[name] = judge_set(known_runs(name, runs, healthy, detector), detector, currents)
    return judged, left_out


def check_healthy(name: str, healthy: dict[Run, list[Recording]]) -> None:
    """Refuse healthy runs too few to leave one out, or whose current falls as the load rises.

    Raises
    ------
    RecordingError
        They are so.
    """
    at_loads, of_profiles = Counter(run[:2] for run in healthy), Counter(run[0] for run in healthy)
    counts = [(named(at), found, DETECTOR.fewest_runs_of_load) for at, found in at_loads.items()]
    counts += [(f"profile '{one}'", found, DETECTOR.fewest_runs) for one, found in of_profiles.items()]
    for what, found, fewest in counts:
        if found <= fewest:
            raise RecordingError(
                f"{name}: {found} healthy runs of {what}, at least {fewest + 1} are needed: each is judged "
                "without itself; record more, or leave these out"
            )
    pairs = [(one, run[1]) for run, cycles in stroke_currents(healthy).items() for one in cycles]
    if current_per_load([one for one, _ in pairs], [load for _, load in pairs]) <= 0:
        raise RecordingError(
            f"{name}: the current of down-strokes falls as the load rises: set_point and load have opposite "
            "signs; turn that of one"
        )


def judge_healthy(healthy: dict[Run, list[Recording]], left_out: list[LeftOut]) -> Judged:
    """Return the healthy set, each run judged by the others; degraded if a run or a cycle is called so."""
    currents = stroke_currents(healthy)
    called = False
    for run, cycles in currents.items():
        others = {other: ones for other, ones in currents.items() if other != run}
        reference = reference_friction(others)[run[:2]]
        estimates = [reference.judge(one.friction_A, single_cycle=True) for one in cycles]
        estimates.append(reference.judge(float(np.mean([one.friction_A for one in cycles]))))
        called = called or any(one.verdict == "degraded" for one in estimates)
    friction = in_newtons(currents, currents)
    return Judged(
        [one.run for one in left_out],
        [cycle for one in left_out for cycle in one.cycles],
        friction,
        dict.fromkeys(friction, (0.0, 0.0)),
        dict.fromkeys(friction, 1.0),
        ["friction"] if called else [],
    )


def judge_set(
    runs: dict[Run, list[Recording]], detector: Detector, healthy: dict[Run, list[StrokeCurrent]]
) -> Judged:
    """Return what the detector and the friction of healthy runs say of a set."""
    currents = stroke_currents(runs)
    reference = reference_friction(healthy)
    change, share, degraded = {}, {}, False
    for at in sorted({run[:2] for run in runs}):
        ones = [one for run, cycles in currents.items() if run[:2] == at for one in cycles]
        estimate = reference[at].judge(float(np.mean([one.friction_A for one in ones])))
        degraded = degraded or estimate.verdict == "degraded"
        scale = FaultScales().friction  # friction × (1 + scale × k)
        change[at] = (scale * estimate.value, scale * (estimate.interval95[1] - estimate.value))
        before = [one.load_A for run, cycles in healthy.items() if run[:2] == at for one in cycles]
        share[at] = float(np.mean([one.load_A for one in ones]) / np.mean(before)) if at[1] else np.nan
    return Judged(
        [detector.judge(cycles) for cycles in runs.values()],
        [detector.judge(one) for cycles in runs.values() for one in cycles],
        in_newtons(currents, healthy),
        change,
        share,
        ["friction"] if degraded else [],
    )


def known_runs(
    name: str, runs: dict[Run, list[Recording]], healthy: dict[Run, list[Recording]], detector: Detector
) -> dict[Run, list[Recording]]:
    """Return the runs whose profile, load and command were recorded healthy; say which others there are."""
    known = {run[:2] for run in healthy}
    foreign = sorted({run[:2] for run in runs} - known)
    for at in foreign:
        say(f"{name}: {named(at)} was never recorded healthy; left out")
    rest: dict[Run, list[Recording]] = {}
    left_out = []
    for run, cycles in runs.items():
        for cycle in cycles if run[:2] in known else ():
            try:
                detector.judge(cycle)
            except RecordingError as error:
                left_out.append(f"{error}; left out")
            else:
                rest.setdefault(run, []).append(cycle)
    say_left_out(name, left_out)
    if not rest:
        raise RecordingError(
            f"{name}: none of its manoeuvres and loads was recorded healthy, in these units; give a healthy "
            "file with them"
        )
    return rest


def stroke_currents(runs: dict[Run, list[Recording]]) -> dict[Run, list[StrokeCurrent]]:
    """Return the parts of the current in each cycle."""
    return {run: [StrokeCurrent.of(one) for one in cycles] for run, cycles in runs.items()}


def reference_friction(healthy: dict[Run, list[StrokeCurrent]]) -> dict[Condition, HealthyFriction]:
    """Return the friction of healthy runs by profile and load."""
    return {
        at: HealthyFriction.learn([cycles for run, cycles in healthy.items() if run[:2] == at])
        for at in sorted({run[:2] for run in healthy})
    }


def in_newtons(
    currents: dict[Run, list[StrokeCurrent]], healthy: dict[Run, list[StrokeCurrent]]
) -> dict[Condition, float]:
    """Return the friction force [N] by condition: the known loads say how much current a newton takes.

    Where all loads are 0, nothing says it: the friction is in amperes then.
    """
    pairs = [(one, run[1]) for run, cycles in healthy.items() for one in cycles]
    per_newton = current_per_load([one for one, _ in pairs], [load for _, load in pairs])
    return {
        at: float(
            np.mean([one.friction_A for run, ones in currents.items() if run[:2] == at for one in ones])
            / (per_newton if np.isfinite(per_newton) else 1.0)
        )
        for at in sorted({run[:2] for run in currents})
    }


def detected(results: Sequence[DetectorResult]) -> float:
    """Return the share that is not like healthy."""
    return sum(not one.like_healthy for one in results) / len(results)


def summary(judged: dict[str, Judged], left_out: list[LeftOut]) -> dict[str, Any]:
    """Return what --json prints."""
    return {
        "false_alarms": {"runs": detected([one.run for one in left_out]), "of": len(left_out)},
        "sets": {name: one.summary() for name, one in judged.items()},
    }


def table(judged: dict[str, Judged], left_out: list[LeftOut], healthy_name: str) -> str:
    """Return the figures as text, with what they rest on."""
    rows = []
    for name, one in judged.items():
        for k, at in enumerate(sorted(one.friction)):
            change, half = one.change[at]
            rows.append(
                (
                    name if k == 0 else "",
                    f"{100 * detected(one.runs):.0f} %" if k == 0 else "",
                    f"{100 * detected(one.cycles):.0f} %" if k == 0 else "",
                    at[0],
                    f"{at[1] / KGF:g}",
                    f"{one.friction[at]:.0f}",
                    "-" if name == healthy_name else f"{100 * change:+.1f} ± {100 * half:.1f} %",
                    "-" if name == healthy_name else f"{100 * one.load_share[at]:.0f} %",
                    (", ".join(one.degraded) or "none") if k == 0 else "",
                )
            )
    names = ("set", "runs", "cycles", "profile", "load [kgf]")
    header = (*names, "friction [N]", "change", "load's current", "degraded")
    lines = [format_table(header, rows), "", shown(left_out)]
    lines += [f"{name}: {one.runs[0].sentence}." for name, one in judged.items() if name != healthy_name]
    lines += [
        account(name, at, one)
        for name, one in judged.items()
        if name != healthy_name and one.degraded
        for at, (change, half) in one.change.items()
        if abs(change) <= half
    ]
    return "\n".join(lines)


def shown(left_out: list[LeftOut]) -> str:
    """Return what the healthy runs, each judged by a detector that never saw it, show of false alarms."""
    alarms = sum(not one.run.like_healthy for one in left_out)
    bound = highest_rate(alarms, len(left_out), DETECTOR.confidence)
    return (
        f"False alarms: {100 * DETECTOR.false_alarm_rate:g} % are asked for; {alarms} of {len(left_out)} "
        "healthy runs alarmed, each judged by a detector that never saw it. That shows at most "
        f"{100 * bound:.2g} % with {100 * DETECTOR.confidence:g} % confidence."
    )


def account(name: str, at: Condition, one: Judged) -> str:
    """Return why friction at a load is not called changed, although it is at another."""
    change, half = one.change[at]
    return (
        f"{name}, {named(at)}: the friction current is that of the healthy runs within "
        f"{100 * max(abs(change + half), abs(change - half)):.1f} %, while the load takes "
        f"{100 * one.load_share[at]:.0f} % of its healthy current: the current shows torque there as "
        "before, but no more friction."
    )


if __name__ == "__main__":
    sys.exit(main())
