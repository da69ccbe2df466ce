"""The base setting, as on a rig: errors, coverage, false alarms and what small faults are detected."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binom

import emaphm as ema
from bench.cases import (
    JUDGED,
    SINGLE,
    Case,
    Outcome,
    alarms,
    coverage,
    detection,
    errors,
    explained,
    false_alarms,
    random_faults,
    recordings_alarmed,
    small_fault,
    spread_of,
)
from bench.comparison import table
from bench.rig import BASE, BITS, CURRENT, EVERYTHING, HEAT_K, LOAD_NM, NOISE_A, Rig
from emaphm.actuator import NAMES

SIZES = (0.05, 0.1)


@dataclass(frozen=True)
class Row:
    """A set-up of the base setting: what is recorded and estimated, and how many cases of each kind."""

    name: str
    rig: Rig
    nuisances: tuple[str, ...] | None
    random: int
    healthy: int
    small: tuple[int, int]
    """Of each kind of small fault, by `SIZES`."""


ROWS = (
    Row("current and line voltage", BASE, None, 300, 500, (50, 30)),
    Row("current alone", Rig(CURRENT), None, 300, 100, (20, 0)),
    Row("current, line voltage, position, speed", Rig(EVERYTHING), None, 60, 60, (0, 0)),
    Row("current and line voltage, nothing estimated besides", BASE, (), 30, 30, (0, 0)),
)
"""Load and temperature are estimated with the faults but in the last."""

MAIN, ALONE = ROWS[:2]

Key = tuple[Row, str, float]
"""Set-up, kind of fault ("random", "healthy" or one of `SINGLE`), and the size of a small one."""


def plan(share: float) -> dict[Key, list[Case]]:
    """Return a `share` of the cases of each row."""

    def seeds(most: int) -> range:
        return range(max(1, round(share * most)) if most else 0)

    cases: dict[Key, list[Case]] = {}
    for row in ROWS:
        cases[row, "random", 0.0] = [
            Case(row.rig, random_faults(seed), seed, row.nuisances) for seed in seeds(row.random)
        ]
        cases[row, "healthy", 0.0] = [
            Case(row.rig, ema.Faults(), seed, row.nuisances) for seed in seeds(row.healthy)
        ]
        for size, most in zip(SIZES, row.small, strict=True):
            for kind in SINGLE if most else ():
                cases[row, kind, size] = [
                    Case(row.rig, small_fault(kind, size, seed), seed, row.nuisances) for seed in seeds(most)
                ]
    return cases


def report(outcomes: Mapping[Key, list[Outcome]]) -> Iterator[str]:
    """Yield the lines of the page's section."""
    yield "\n## As on a rig: the base setting\n"
    yield (
        f"{NOISE_A:g} A of noise on the current, all channels through {BITS}-bit converters, a load anywhere "
        f"within ±{LOAD_NM:g} N·m and windings within ±{HEAT_K:g} K, neither recorded; 0.5 s at 5 kHz. Load "
        "and temperature are estimated with the faults unless the row says otherwise. Faults as above. "
        "Times are those of two diagnoses side by side.\n"
    )
    yield _errors(outcomes)
    count = len(outcomes[MAIN, "random", 0.0])
    low, high = binom.interval(0.95, count, 0.95)
    yield (
        "\nShare of the random cases whose 95 % interval holds the truth. Of a component whose intervals "
        f"are just right, {count} cases show {100 * low / count:.1f} to {100 * high / count:.1f} % nineteen "
        "times in twenty; more says that its intervals are wider than they need be, less that they are too "
        "narrow:\n"
    )
    yield _coverage(outcomes)
    yield (
        "\nMedian half-width of these intervals, in the unit of the components (1 is the whole range). Two "
        "set-ups that cover equally often differ in this:\n"
    )
    yield _widths(outcomes)
    yield (
        "\nHealthy recordings. A false alarm is a component called degraded; the phase of the eccentricity "
        "is not counted, it shares the verdict of the eccentricity itself.\n"
    )
    yield _healthy(outcomes)
    yield (
        "\nSingle small faults, the rest healthy: how often the faulty component is called degraded, and "
        "how often any other is. Sizes are those of the component; a gain is that far from its healthy 0.5.\n"
    )
    yield _small(outcomes)


def _errors(outcomes: Mapping[Key, list[Outcome]]) -> str:
    rows = []
    for row in ROWS:
        of_row = outcomes[row, "random", 0.0]
        found = errors(of_row)
        rows.append(
            [
                row.name,
                f"{len(of_row)}",
                spread_of(found),
                f"{100 * explained(of_row):.0f} %",
                f"{np.median([one.seconds for one in of_row]):.2f}",
            ]
        )
    return table(
        ["recorded", "cases", "error: median / 95th percentile / worst, %", "explained", "median time, s"],
        rows,
    )


def _coverage(outcomes: Mapping[Key, list[Outcome]]) -> str:
    rows = [
        [row.name, *(f"{100 * share:.1f} %" for share in coverage(outcomes[row, "random", 0.0]))]
        for row in ROWS
    ]
    return table(["recorded", *NAMES], rows)


def _widths(outcomes: Mapping[Key, list[Outcome]]) -> str:
    rows = [
        [
            row.name,
            *(
                f"{width:.4f}"
                for width in np.median([one.half_widths for one in outcomes[row, "random", 0.0]], axis=0)
            ),
        ]
        for row in ROWS
    ]
    return table(["recorded", *NAMES], rows)


def _healthy(outcomes: Mapping[Key, list[Outcome]]) -> str:
    rows = []
    for row in ROWS:
        of_row = outcomes[row, "healthy", 0.0]
        found = errors(of_row)
        rows.append(
            [
                row.name,
                f"{len(of_row)}",
                f"{100 * false_alarms(of_row):.2f} %",
                f"{100 * recordings_alarmed(of_row):.1f} %",
                _named(of_row),
                f"{100 * min(coverage(of_row)):.1f} %",
                f"{100 * explained(of_row):.1f} %",
                spread_of(found),
            ]
        )
    return table(
        [
            "recorded",
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


def _named(outcomes: Sequence[Outcome]) -> str:
    """Return which components raised how many alarms."""
    counts = np.sum([alarms(one) for one in outcomes], axis=0)
    return ", ".join(f"{name} {n}" for name, n in zip(JUDGED, counts, strict=True) if n) or "none"


def _small(outcomes: Mapping[Key, list[Outcome]]) -> str:
    rows = []
    for row in ROWS:
        for size in SIZES:
            of_size = {kind: outcomes[row, kind, size] for kind in SINGLE if (row, kind, size) in outcomes}
            if of_size:
                others = [one for cases in of_size.values() for one in cases]
                rows.append(
                    [
                        f"{row.name}, {100 * size:.0f} %",
                        f"{len(others) // len(SINGLE)}",
                        *(f"{100 * detection(cases):.0f} %" for cases in of_size.values()),
                        f"{100 * false_alarms(others):.2f} %",
                    ]
                )
    return table(["recorded, size", "recordings each", *SINGLE, "others, called degraded"], rows)
