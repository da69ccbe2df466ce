"""A note on failures of the fleet at levels far below the limits: by other requirements, or another cause."""

from typing import TYPE_CHECKING

import numpy as np

from emaphm.prognosis.columns import level_of
from emaphm.prognosis.prior import NEW

if TYPE_CHECKING:
    from collections.abc import Sequence

    from emaphm.prognosis.evidence import Evidence, Observation
    from emaphm.prognosis.requirements.margins import Limit

NEAR = 0.6
"""Consumed share of the margin to a limit, below which at the last diagnosis a failure was not near it."""

COMMON = 0.2
"""Share of the failures from which on a note says so: wear that is fast at last, or a jump, makes some."""


def failure_notes(fleet: "Sequence[Evidence]", limits: "Sequence[Limit]") -> list[str]:
    """Return a note where many failures of a `fleet` came near none of the `limits`.

    None where a limit is of a measure, about which failures say nothing.
    """
    if any(one.component is None for one in limits):
        return []
    shares = []
    for unit in fleet:
        for start, failure in unit.failed_lives:
            life = [one for one in unit.used if start < one.hours <= failure]
            shares += [max(_consumed_share(life[-1], one) for one in limits)] if life else []
    far = sum(share < NEAR for share in shares)
    if not far or far < COMMON * len(shares):
        return []
    note = (
        f"of {len(shares)} failures of other units {far} came with no level beyond {100 * NEAR:.0f} % of the "
        "way to a limit: by narrower requirements, or by something else; they count as failures by these "
        "limits all the same, so that the forecast may be early"
    )
    return [note]


def _consumed_share(seen: "Observation", limit: "Limit") -> float:
    """Return the consumed share of the margin to a limit, 0 where a new unit has none."""
    full = float(limit.margin(level_of(NEW, str(limit.component))))
    left = float(limit.margin(level_of(np.asarray(seen.level), str(limit.component))))
    return 1 - left / full if full > 0 else 0.0
