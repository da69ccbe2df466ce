"""Note on failures of the fleet at levels far below the limits: other requirements, or another cause."""

from typing import TYPE_CHECKING

import numpy as np

from emaphm.prognosis.columns import level_of
from emaphm.prognosis.prior import NEW

if TYPE_CHECKING:
    from collections.abc import Sequence

    from emaphm.prognosis.evidence import Evidence, Observation
    from emaphm.prognosis.requirements.margins import Limit

NEAR = 0.6
"""Consumed share of the margin at the last diagnosis, below which a failure was not near the limit."""

COMMON = 0.2
"""Share of such failures from which on there is a note: fast wear at the end, or a jump, causes some."""


def failure_notes(fleet: "Sequence[Evidence]", limits: "Sequence[Limit]") -> list[str]:
    """Return a note if many failures of a `fleet` occurred near none of the `limits`.

    There is no note if a limit is on a measure, because the levels then do not indicate how near it was.
    """
    if any(limit.component is None for limit in limits):
        return []
    shares = []
    for unit in fleet:
        for start, failure in unit.failed_lives:
            life = [diagnosis for diagnosis in unit.used if start < diagnosis.hours <= failure]
            shares += [max(_consumed_share(life[-1], limit) for limit in limits)] if life else []
    far_count = sum(share < NEAR for share in shares)
    if not far_count or far_count < COMMON * len(shares):
        return []
    note = (
        f"of {len(shares)} failures of other units {far_count} came with no level beyond {100 * NEAR:.0f} % "
        "of the way to a limit: because of narrower requirements, or of another cause; they are still "
        "counted as failures by these limits, so that the forecast may be too early"
    )
    return [note]


def _consumed_share(diagnosis: "Observation", limit: "Limit") -> float:
    """Return the consumed share of the margin to a limit; 0 if a new unit has no margin."""
    full_margin = float(limit.margin(level_of(NEW, str(limit.component))))
    margin = float(limit.margin(level_of(np.asarray(diagnosis.level), str(limit.component))))
    return 1 - margin / full_margin if full_margin > 0 else 0.0
