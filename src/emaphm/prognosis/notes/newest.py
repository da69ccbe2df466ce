"""A note on a newest diagnosis that the forecast hardly follows."""

from typing import TYPE_CHECKING

import numpy as np

from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.arrays import Array
from emaphm.prognosis.columns import ECCENTRICITY, columns_of
from emaphm.prognosis.laws import Mask

if TYPE_CHECKING:
    from emaphm.prognosis.evidence import Evidence

SIGNIFICANT = 4.0
"""Standard errors that the newest diagnosis is off the believed level, from which on a note says so."""

WORTH_SAYING = 0.05
"""And its distance at least."""


def newest_notes(evidence: "Evidence", level: Array) -> list[str]:
    """Return a note where the newest explained diagnosis is far from what is believed of its own hours.

    `level` are the levels (n, 8) that may have been then, given that diagnosis and those before: the filter
    takes it mostly for an outlier until another one confirms it. Wear that came after its hours does not
    count, nor does a component that was replaced since.
    """
    newest = evidence.used[-1] if evidence.used else None
    if newest is None:
        return []
    believed = np.median(level, axis=0)
    deviations = np.abs(newest.level - believed)
    far = (
        newest.seen
        & (deviations > SIGNIFICANT * np.sqrt(np.diag(newest.covariance)))
        & (deviations > WORTH_SAYING)
    )
    for hours, part in evidence.replacements:
        if hours >= newest.hours:
            far[columns_of(part)] = False
    if not far.any():
        return []
    which = "newest" if evidence.unexplained is None else "newest explained"
    shown = zip(_in_words(newest.level, far), _in_words(believed, far), strict=True)
    each = ", ".join(f"{name} {seen} ({taken})" for (name, seen), (_, taken) in shown)
    note = (
        f"the {which} diagnosis, of {newest.hours:.9g} h, shows {each}; in brackets what the forecast takes "
        "for the level then: one so far from those before counts mostly as an outlier until a further one "
        "confirms it; record again soon"
    )
    return [note]


def _in_words(level: Array, where: Mask) -> list[tuple[str, str]]:
    """Return the components `where` (8,) and their levels as text, an eccentricity with its direction."""
    words = [(CARTESIAN_NAMES[i], f"{level[i]:.3g}") for i in np.flatnonzero(where) if i not in ECCENTRICITY]
    if where[list(ECCENTRICITY)].any():
        x, y = level[list(ECCENTRICITY)]
        words.append(("eccentricity", f"{np.hypot(x, y):.3g} at {np.degrees(np.arctan2(y, x)):.0f}°"))
    return words
