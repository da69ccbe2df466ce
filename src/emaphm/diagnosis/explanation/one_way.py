"""Verdicts on a manoeuvre in one direction, which does not identify small faults, nor friction under a load.

Without reversal, friction has the same effect as a load, the backlash is crossed once, and the motor passes
each angle once. The optimum lies in a flat valley, the search may end away from it, and the covariance of the
linear model there is too small. Of 32 single steps and staircases, 4 had a false eccentricity of 5 to 12 %,
one a false backlash and one a false friction; of 64 recordings of pulses and square waves, two had a false
friction of 3 or 4 %.
"""

from collections.abc import Mapping

import numpy as np

from emaphm.actuator.faults import HEALTHY
from emaphm.arrays import Array
from emaphm.diagnosis.explanation.motion import modelled_position
from emaphm.diagnosis.verdict import VERDICT, Estimate, distance_from, undecided, with_phase_undecided
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult

SMALLEST_RETURN = 0.1
"""Smallest backward path that counts as a reversal, relative to the forward path; overshoot is less."""

LIKE_A_LOAD = ("friction", "backlash")
"""Components that are never called degraded by a manoeuvre in one direction, unless the load is known."""

REASON = "the actuator moves in one direction only, and faults look alike; record a manoeuvre that reverses"


def undecided_where_one_way(components: Mapping[str, Estimate], result: SearchResult) -> dict[str, Estimate]:
    """Return the `components` of `result`; slightly degraded ones are undecided if it moves in one direction.

    A component is slightly degraded if its interval begins less than `VERDICT.hidden_fault` from healthy;
    degraded components `LIKE_A_LOAD` are always undecided unless the load is known.
    """
    confounded = LIKE_A_LOAD if "load" in result.objective.space.coordinates else ()
    slight = {
        name: undecided(name, component, REASON)
        for name, component in components.items()
        if component.verdict == "degraded"
        and name != "eccentricity_phase"
        and (
            name in confounded
            or distance_from(getattr(HEALTHY, name), component.interval95) < VERDICT.hidden_fault
        )
    }
    if not slight or not moves_one_way(result.objective, result.point):
        return dict(components)
    return with_phase_undecided({**components, **slight}, components)


def moves_one_way(objective: MapObjective, point: Array) -> bool:
    """Return whether the backward path of the model at `point` (d,) is below `SMALLEST_RETURN`."""
    changes = np.diff(modelled_position(objective, point))
    paths = (float(changes[changes > 0].sum()), float(-changes[changes < 0].sum()))
    return min(paths) < SMALLEST_RETURN * max(paths)
