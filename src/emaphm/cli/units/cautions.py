"""Cautions below a table of prognoses: units with an uncertain remaining useful life, or with notes."""

from collections.abc import Mapping, Sequence
from typing import Any


def cautions(prognoses: Sequence[Mapping[str, Any]], more: str) -> list[str]:
    """Return the lines of caution for `prognoses`, in the form that `emaphm prognose --json` prints.

    `more` is the command that shows the notes of one unit.
    """
    from emaphm.prognosis.notes.life import ENOUGH, without_rate

    from_prior = [made["unit"] for made in prognoses if without_rate(made["diagnoses"]["flights"])]
    unexplained = [made["unit"] for made in prognoses if not made["diagnoses"]["newest_explained"]]
    noted = [made["unit"] for made in prognoses if made["notes"]]
    lines = []
    if from_prior:
        lines.append(
            "remaining useful life mostly from the prior, with explained diagnoses of fewer than "
            f"{ENOUGH} flights: {', '.join(from_prior)}"
        )
    if unexplained:
        lines.append(
            "newest recording not explained, and not used in the prognosis: " + ", ".join(unexplained)
        )
    if noted:
        lines.append(f"notes on {len(noted)} of {len(prognoses)} units; for the notes of a unit: {more}")
    return lines
