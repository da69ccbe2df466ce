"""How right the identification is: what was asked of it and what it reached, noise-free and as on a rig.

    python -m bench.accuracy docs/accuracy.md

A second argument between 0 and 1 takes that share of the cases, to try the machinery. Recordings are
simulated by the reference model; errors are those of `emaphm.error_percent`, in percent.
"""

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from bench import base, exact
from bench.base import MAIN
from bench.cases import SINGLE, Outcome, coverage, detection, errors, false_alarms, measured
from bench.comparison import table
from emaphm.actuator import NAMES

Exact = Mapping[exact.Key, list[Outcome]]
Base = Mapping[base.Key, list[Outcome]]

MET = {True: "yes", False: "no", None: "–"}


def asked_and_reached(without: Exact, rig: Base) -> str:
    """Return the table of what was asked, what was reached, and whether that is enough."""
    rows = [*_without_noise(without), *_on_rig(rig)]
    return table(["what", "asked", "reached", "met"], [[*row[:3], MET[row[3]]] for row in rows])


def _without_noise(outcomes: Exact) -> Iterator[tuple[str, str, str, bool | None]]:
    one, many = errors(outcomes[exact.SINGLES]), errors(outcomes[exact.SEVERAL])
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
    for key, what in ((exact.SEARCHES, "ten searches"), (exact.RECORDINGS, "ten recordings")):
        enough = exact.within(outcomes[key])
        yield (
            f"the thesis's multiple faults, {what}",
            "≤ 2 % in 10 of 10",
            f"{enough} of {exact.TEN}, the worst {errors(outcomes[key]).max():.2f} %",
            enough == exact.TEN,
        )


def _on_rig(outcomes: Base) -> Iterator[tuple[str, str, str, bool | None]]:
    cases = outcomes[MAIN, "random", 0.0]
    middle, most = float(np.median(errors(cases))), float(np.percentile(errors(cases), 95))
    yield (
        f"base setting, {MAIN.name}, {len(cases)} random vectors: median / 95th percentile",
        "≤ 2 / 6 %",
        f"{middle:.2f} / {most:.2f} %",
        middle <= 2 and most <= 6,
    )
    for row in (MAIN, base.ALONE):
        cases = outcomes[row, "random", 0.0]
        shares = coverage(cases)
        low, high = int(np.argmin(shares)), int(np.argmax(shares))
        yield (
            f"base setting, {row.name}, {len(cases)} random vectors: coverage of the 95 % intervals",
            "92 to 98 %, each component",
            f"{100 * shares[low]:.1f} % ({NAMES[low]}) to {100 * shares[high]:.1f} % ({NAMES[high]})",
            bool(shares[low] >= 0.92 and shares[high] <= 0.98),
        )
    healthy = outcomes[MAIN, "healthy", 0.0]
    alarmed = false_alarms(healthy)
    yield (
        f"base setting, {MAIN.name}, {len(healthy)} healthy recordings: false alarms over all components",
        "≤ 0.5 %",
        f"{100 * alarmed:.2f} %",
        alarmed <= 0.005,
    )
    small = base.SIZES[0]
    rates = {kind: detection(outcomes[MAIN, kind, small]) for kind in SINGLE}
    yield (
        f"{len(outcomes[MAIN, SINGLE[0], small])} each of {100 * small:.0f} % faults, {MAIN.name}",
        "detected, each with its rate",
        ", ".join(f"{kind} {100 * rate:.0f} %" for kind, rate in rates.items()),
        None,
    )


def report(without: Exact, rig: Base) -> Iterator[str]:
    """Yield the lines of the page."""
    yield "# Accuracy of the identification\n"
    yield (
        "Made by `make study`. Recordings by the reference model of the thesis's actuator, a 0.5 s chirp at "
        "5 kHz; errors in percent as in `emaphm.error_percent`. Random vectors have shorts up to 0.7, all "
        "other components anywhere in [0, 1]. Case n is made from seed n, its recording and its search. "
        "[limits.md](limits.md) has what becomes of the base setting when one thing is worse.\n"
    )
    yield "## What was asked and what was reached\n"
    yield asked_and_reached(without, rig)
    yield ""
    yield from exact.report(without)
    yield from base.report(rig)


def main() -> None:
    """Write the page to the path given."""
    share = float(sys.argv[2]) if len(sys.argv) > 2 else 1.0
    without = measured(exact.plan(share), "noise-free")
    rig = measured(base.plan(share), "base setting")
    Path(sys.argv[1]).write_text("\n".join(report(without, rig)) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
