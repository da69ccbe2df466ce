"""The actuator as described, noise-free, from the current alone: single, random and the thesis's faults."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

import emaphm as ema
from bench.cases import Case, Outcome, coverage, errors, heavy_faults, random_faults, spread_of
from bench.comparison import table
from bench.rig import IDEAL, NOISE_A
from emaphm.estimation.bias_correction import MAX_CORRECTIONS

RANDOM, UNCORRECTED, HEAVY, TEN = 200, 60, 60, 10
MULTIPLE = ema.Faults(0.25, 0.75, 0.8, 0.8, 0.8, 0.25, 0.5, 0.75)
LOW_HIGH = {
    "friction": (0.25, 0.75),
    "backlash": (0.25, 0.75),
    "short_a": (0.2, 0.8),
    "eccentricity": (0.25, 0.75),
    "gain": (0.25, 0.75),
}
"""The thesis's ten single faults (6.5)."""

THESIS_SINGLE, THESIS_MULTIPLE = 1.40, 64.2
"""Errors [%] of the thesis: the mean of its best method on single faults, and its only try at several."""

SHAKEN_A = 1e-3
"""Noise on the reference current that makes recordings differ: by switching alone, as any noise would."""

HEAVY_NOISES = (0.0, NOISE_A)

Key = tuple[str, float, int]
"""Kind of cases, noise on the recorded current [A], most turns of correction."""

SINGLES, SEVERAL = ("single", 0.0, MAX_CORRECTIONS), ("random", 0.0, MAX_CORRECTIONS)
SEARCHES, RECORDINGS = ("searches", 0.0, MAX_CORRECTIONS), ("recordings", 0.0, MAX_CORRECTIONS)


def plan(share: float) -> dict[Key, list[Case]]:
    """Return the cases; of the numerous ones a `share`."""
    singles = [ema.Faults.from_mapping({name: value}) for name, two in LOW_HIGH.items() for value in two]
    cases: dict[Key, list[Case]] = {}
    for noise, turns, most in (
        (0.0, MAX_CORRECTIONS, RANDOM),
        (NOISE_A, MAX_CORRECTIONS, RANDOM),
        (0.0, 0, UNCORRECTED),
    ):
        rig = replace(IDEAL, noise=noise)
        cases["single", noise, turns] = [Case(rig, one, i, (), turns) for i, one in enumerate(singles)]
        cases["random", noise, turns] = [
            Case(rig, random_faults(seed), seed, (), turns) for seed in range(max(1, round(share * most)))
        ]
    for noise in HEAVY_NOISES:
        rig = replace(IDEAL, noise=noise)
        cases["heavy", noise, MAX_CORRECTIONS] = [
            Case(rig, heavy_faults(seed), seed, ()) for seed in range(max(1, round(share * HEAVY)))
        ]
    cases[SEARCHES] = [Case(IDEAL, MULTIPLE, seed, ()) for seed in range(TEN)]
    shaken = replace(IDEAL, controller_noise=SHAKEN_A)
    cases[RECORDINGS] = [Case(shaken, MULTIPLE, seed, ()) for seed in range(TEN)]
    return cases


def report(outcomes: Mapping[Key, list[Outcome]]) -> Iterator[str]:
    """Yield the lines of the page's section."""
    yield "## Noise-free, the actuator as described\n"
    yield (
        "The current alone is recorded, exactly or with noise; load and temperature are nominal and "
        f"nothing is estimated besides the faults. The thesis's best method has {THESIS_SINGLE:.2f} % "
        f"on the ten single faults. Without bias correction, {len(outcomes['random', 0.0, 0])} of the random "
        "vectors.\n"
    )
    rows = []
    for kind, noise, turns in outcomes:
        if kind == "random":
            one, many = (errors(outcomes[which, noise, turns]) for which in ("single", kind))
            rows.append(
                [
                    "on" if turns else "off",
                    f"{noise:g}",
                    f"{one.mean():.2f} / {one.max():.2f}",
                    spread_of(many),
                ]
            )
    yield table(
        [
            "bias correction",
            "noise, A rms",
            "single faults: mean / worst, %",
            "random: median / 95th percentile / worst, %",
        ],
        rows,
    )
    yield (
        f"\nThe thesis's multiple faults ({THESIS_MULTIPLE} % there), ten times: one recording searched from "
        "ten seeds, and ten recordings whose switching differs by a noise on the reference current of "
        f"{SHAKEN_A:g} A, each searched from a seed of its own.\n"
    )
    names = {SEARCHES: "ten searches of one recording", RECORDINGS: "ten recordings"}
    yield table(
        ["multiple faults", "error of each, %", "at most 2 %"],
        [
            [
                name,
                ", ".join(f"{error:.2f}" for error in errors(outcomes[key])),
                f"{within(outcomes[key])} of {TEN}",
            ]
            for key, name in names.items()
        ],
    )

    yield (
        "\nShorts of 0.5 to 0.85 in all three phases, everything else anywhere: beyond what the averaged "
        "model is meant for, with the current at its limit most of the time. Some of these actuators are too "
        "weak to move; their diagnosis says so, and tells next to nothing else.\n"
    )
    yield _heavy(outcomes)


def _heavy(outcomes: Mapping[Key, list[Outcome]]) -> str:
    rows = []
    for noise in HEAVY_NOISES:
        of_noise = outcomes["heavy", noise, MAX_CORRECTIONS]
        moved = [one for one in of_noise if one.moves]
        found = errors(moved)
        rows.append(
            [
                f"{noise:g}",
                f"{len(moved)} of {len(of_noise)}",
                spread_of(found),
                f"{100 * np.mean(found <= 2):.0f} %",
                f"{100 * np.mean(found <= 5):.0f} %",
                f"{100 * min(coverage(moved)):.0f} %",
                f"{sum(one.explained for one in moved if one.error > 5)} of {np.sum(found > 5)}",
            ]
        )
    return table(
        [
            "noise, A rms",
            "move",
            "error: median / 95th percentile / worst, %",
            "at most 2 %",
            "at most 5 %",
            "coverage: least",
            "of the others, called explained",
        ],
        rows,
    )


def within(outcomes: list[Outcome]) -> int:
    """Return how many have an error of at most 2 %."""
    return int(np.sum(errors(outcomes) <= 2.0))
