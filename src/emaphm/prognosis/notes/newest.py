"""Note on a newest diagnosis that the filter mostly treats as an outlier."""

from typing import TYPE_CHECKING

import numpy as np

from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.arrays import Array
from emaphm.prognosis.columns import ECCENTRICITY, columns_of
from emaphm.prognosis.laws import Mask

if TYPE_CHECKING:
    from emaphm.prognosis.evidence import Evidence

SIGNIFICANT = 4.0
"""Deviation of the newest diagnosis from the filtered level, in standard errors, for a note."""

WORTH_SAYING = 0.05
"""Least deviation for a note."""


def newest_notes(evidence: "Evidence", level: Array) -> list[str]:
    """Return a note if the newest explained diagnosis is far from the filtered level at its hours.

    `level` are samples (n, 8) of the levels at these hours, given this diagnosis and the earlier ones: the
    filter mostly treats it as an outlier until another diagnosis confirms it. Later wear is not included, and
    components replaced since are ignored.
    """
    newest = evidence.used[-1] if evidence.used else None
    if newest is None:
        return []
    filtered = np.median(level, axis=0)
    deviation = np.abs(newest.level - filtered)
    far = (
        newest.seen
        & (deviation > SIGNIFICANT * np.sqrt(np.diag(newest.covariance)))
        & (deviation > WORTH_SAYING)
    )
    for hours, part in evidence.replacements:
        if hours >= newest.hours:
            far[columns_of(part)] = False
    if not far.any():
        return []
    newest_text = "newest" if evidence.unexplained is None else "newest explained"
    pairs = zip(_level_texts(newest.level, far), _level_texts(filtered, far), strict=True)
    levels_text = ", ".join(f"{name} {diagnosed} ({forecast})" for (name, diagnosed), (_, forecast) in pairs)
    note = (
        f"the {newest_text} diagnosis, of {newest.hours:.9g} h, has {levels_text}; in brackets the level of "
        "the forecast at these hours: a diagnosis so far from the earlier ones counts mostly as an outlier "
        "until another one confirms it; record again soon"
    )
    return [note]


def _level_texts(level: Array, where: Mask) -> list[tuple[str, str]]:
    """Return names and levels as text of the components `where` (8,) is True; eccentricity with direction."""
    texts = [(CARTESIAN_NAMES[i], f"{level[i]:.3g}") for i in np.flatnonzero(where) if i not in ECCENTRICITY]
    if where[list(ECCENTRICITY)].any():
        x, y = level[list(ECCENTRICITY)]
        texts.append(("eccentricity", f"{np.hypot(x, y):.3g} at {np.degrees(np.arctan2(y, x)):.0f}°"))
    return texts
