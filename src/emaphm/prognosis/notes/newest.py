"""A note on a newest diagnosis that the forecast hardly follows."""

from typing import TYPE_CHECKING

import numpy as np

from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.arrays import Array

if TYPE_CHECKING:
    from emaphm.prognosis.evidence import Evidence

SIGNIFICANT = 4.0
"""Standard errors that the newest diagnosis is off the level now, from which on a note says so."""

WORTH_SAYING = 0.05
"""And its distance at least."""


def newest_notes(evidence: "Evidence", level: Array) -> list[str]:
    """Return a note where the newest diagnosis is far from the levels (n, 8) that may be now.

    The filter takes it mostly for an outlier until another one confirms it.
    """
    newest = evidence.used[-1] if evidence.used else None
    if newest is None or any(hours >= newest.hours for hours, _ in evidence.replacements):
        return []
    now = np.median(level, axis=0)
    apart = np.abs(newest.level - now)
    far = newest.seen & (apart > SIGNIFICANT * np.sqrt(np.diag(newest.covariance))) & (apart > WORTH_SAYING)
    if not far.any():
        return []
    rows = np.flatnonzero(far)
    each = ", ".join(f"{CARTESIAN_NAMES[i]} {newest.level[i]:.3g} ({now[i]:.3g})" for i in rows)
    note = (
        f"the newest diagnosis, of {newest.hours:.9g} h, shows {each}; in brackets what is forecast from: "
        "one so far from those before counts mostly as an outlier until a further one confirms it; record "
        "again soon"
    )
    return [note]
