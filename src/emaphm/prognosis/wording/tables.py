"""Levels and requirements of a prognosis as tables of text."""

import math
from collections.abc import Mapping
from typing import Any

from emaphm.text_table import TextTable


def level_table(levels: Mapping[str, Mapping[str, Any]]) -> TextTable:
    """Return the table of the levels of `Prognosis.levels`, with the most likely law of each component."""
    rows = tuple(
        (
            name,
            f"{level['median']:z.3f}",
            " to ".join(f"{end:z.3f}" for end in level["interval90"]),
            _most_likely_law(level["laws"]),
        )
        for name, level in levels.items()
    )
    return TextTable(("component", "level", "90 % interval", "most likely law"), rows)


def requirement_table(requirements: Mapping[str, Mapping[str, Any]], horizon: float) -> TextTable:
    """Return the table of the requirements of `Prognosis.requirements` within the `horizon` [h]."""
    rows = tuple(_requirement(name, requirement) for name, requirement in requirements.items())
    return TextTable(("requirement", "now", "90 % interval", f"fails within {horizon:.9g} h"), rows)


def _requirement(name: str, requirement: Mapping[str, Any]) -> tuple[str, ...]:
    value, interval = value_and_interval(requirement)
    return name, value, interval, f"{100 * requirement['probability_of_failure']:.1f} %"


def value_and_interval(requirement: Mapping[str, Any]) -> tuple[str, str]:
    """Return the "value" with its "unit" and the "interval90" of a requirement as text.

    All numbers are rounded to the second digit of the interval's width; None becomes "not reached".
    """
    numbers = (requirement["value"], *requirement["interval90"])
    reached = [x for x in numbers if x is not None]
    width = max(reached, default=0.0) - min(reached, default=0.0)
    decimals = max(0, 1 - math.floor(math.log10(width))) if width > 0 else None
    value, low, high = (
        "not reached" if x is None else f"{x:.4g}" if decimals is None else f"{x:z.{decimals}f}"
        for x in numbers
    )
    unit = "" if requirement["unit"] == "-" else f" {requirement['unit']}"
    return f"{value}{unit}", f"{low} to {high}"


def _most_likely_law(laws: Mapping[str, float]) -> str:
    name = max(laws, key=laws.__getitem__)
    return f"{name} ({100 * laws[name]:.0f} %)"
