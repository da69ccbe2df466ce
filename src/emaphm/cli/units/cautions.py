"""What is said below a table of many prognoses: whose life is in doubt, and where to look."""

from collections.abc import Mapping, Sequence
from typing import Any


def cautions(prognoses: Sequence[Mapping[str, Any]], more: str) -> list[str]:
    """Return lines on prognoses, each as `emaphm prognose --json` prints it.

    `more` is the command that shows all of a unit.
    """
    from emaphm.prognosis.notes.life import ENOUGH, without_rate

    few = [one["unit"] for one in prognoses if without_rate(one["diagnoses"]["used"])]
    odd = [one["unit"] for one in prognoses if not one["diagnoses"]["newest_explained"]]
    noted = [one["unit"] for one in prognoses if one["notes"]]
    lines = []
    if few:
        lines.append(f"mostly by the prior, with fewer than {ENOUGH} explained diagnoses: {', '.join(few)}")
    if odd:
        lines.append(
            f"the newest recording is not explained, and the forecast is without it: {', '.join(odd)}"
        )
    if noted:
        lines.append(f"notes on {len(noted)} of {len(prognoses)} units; all of a unit: {more}")
    return lines
