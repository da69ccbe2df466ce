"""A plan that takes almost no time, and the part of its results that must not depend on the run."""

import polars as pl

from emaphm.study import Plan, Store

TEXT = """\
name = "small"
runs = 3

[manoeuvre]
duration = 0.05

[cases]
worn = { friction = 0.3 }
loose = { backlash = 0.4, gain = 0.7 }

[[methods]]
method = "dragonfly"
label = "few"
population = 4
iterations = 3

[[methods]]
method = "da"
label = "more"
population = 8
iterations = 5
"""
"""A plan of twelve runs of a few milliseconds."""


def with_(*changes: tuple[str, str], top: str = "", end: str = "") -> str:
    """Return `TEXT` with pieces replaced, and with keys before and after it."""
    text = TEXT
    for old, new in changes:
        if old not in text:
            raise ValueError(f"the plan has no '{old}'")
        text = text.replace(old, new)
    return f"{top}\n{text}\n{end}\n"


def plan(*changes: tuple[str, str], top: str = "", end: str = "") -> Plan:
    return Plan.from_toml_text(with_(*changes, top=top, end=end))


def table(store: Store) -> pl.DataFrame:
    """Return the results without the columns that depend on the clock."""
    return timeless(store.results)


def timeless(results: pl.DataFrame) -> pl.DataFrame:
    return results.drop("seconds", "wall_seconds", "cpu_seconds")
