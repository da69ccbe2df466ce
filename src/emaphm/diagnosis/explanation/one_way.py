"""What a manoeuvre that never reverses cannot show: small faults, and friction apart from a load.

Friction then acts as a load does, the backlash is crossed once, and the motor passes each angle once. The
optimum lies in a flat valley, the search may end off it, and the linear model there claims more than is
known. Of 32 single steps and staircases 4 had an eccentricity of 5 to 12 % that was not there, one a backlash
and one a friction; of 64 recordings of pulses and square waves, two had a friction of 3 or 4 %.
"""

from collections.abc import Mapping

import numpy as np

from emaphm.actuator.faults import HEALTHY
from emaphm.arrays import Array
from emaphm.diagnosis.explanation.motion import modelled_position
from emaphm.diagnosis.verdict import VERDICT, Estimate, undecided, with_phase_undecided
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult

SMALLEST_RETURN = 0.1
"""Share of its way that an actuator must go back: a step's overshoot is less."""

LIKE_A_LOAD = ("friction", "backlash")
"""Components that are never called degraded by such a manoeuvre, unless the load is known."""

REASON = "the actuator moves one way only, and faults look alike there; record a manoeuvre that reverses"


def undecided_where_one_way(components: Mapping[str, Estimate], result: SearchResult) -> dict[str, Estimate]:
    """Return the `components` of `result`; undecided those degraded by little, if it moves one way only.

    By little is what leaves an interval that begins less than `VERDICT.hidden_fault` from healthy; of those
    `LIKE_A_LOAD`, anything.
    """
    unknown = LIKE_A_LOAD if "load" in result.objective.space.coordinates else ()
    small = {
        name: undecided(name, one, REASON)
        for name, one in components.items()
        if one.verdict == "degraded"
        and name != "eccentricity_phase"
        and (name in unknown or _from_healthy(name, one) < VERDICT.hidden_fault)
    }
    if not small or not moves_one_way(result.objective, result.point):
        return dict(components)
    return with_phase_undecided({**components, **small}, components)


def _from_healthy(name: str, estimate: Estimate) -> float:
    """Return how far the interval of a component begins from its healthy value."""
    healthy = float(getattr(HEALTHY, name))
    low, high = estimate.interval95
    return max(low - healthy, healthy - high)


def moves_one_way(objective: MapObjective, point: Array) -> bool:
    """Return whether the model at `point` (d,) never goes back by more than `SMALLEST_RETURN` of its way."""
    moved = np.diff(modelled_position(objective, point))
    ways = (float(moved[moved > 0].sum()), float(-moved[moved < 0].sum()))
    return min(ways) < SMALLEST_RETURN * max(ways)
