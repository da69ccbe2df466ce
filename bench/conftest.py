"""Summary of the benchmarks: the ratio of each time to its reference, and the budget of this ratio."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

MANOEUVRE_S = 0.5
"""Duration [s] of the default manoeuvre, the reference of speed."""

ROWS = pytest.StashKey[list["Row"]]()


@dataclass(frozen=True)
class Row:
    """A line of the summary: the measured task, its time [s], its ratio and the budget."""

    what: str
    seconds: float
    ratio: float
    against: str
    budget: str


Report = Callable[..., None]


@pytest.fixture
def report(request: pytest.FixtureRequest, benchmark: Any) -> Report:
    """Return a function that stores the benchmark's median per run and its ratio to `reference` seconds."""
    rows = request.config.stash.setdefault(ROWS, [])

    def note(
        what: str,
        *,
        budget: str,
        runs: int = 1,
        reference: float = MANOEUVRE_S,
        against: str = "real time",
    ) -> None:
        seconds = benchmark.stats.stats.median / runs
        rows.append(Row(what, seconds, reference / seconds, against, budget))

    return note


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Print the table of ratios after the table of the benchmarks."""
    rows = config.stash.get(ROWS, [])
    if not rows:
        return
    terminalreporter.section("speed as ratios (median of the rounds, one core)")
    for row in rows:
        terminalreporter.write_line(
            f"{row.what:<58} {row.seconds * 1e3:>10.3f} ms  {row.ratio:>9.4g} × {row.against:<14} "
            f"budget: {row.budget}"
        )
