"""A rotor whose electrical zero is not where the zero of the position, or of the command, puts it.

Commutation follows the rotor. Where its angle is not recorded, the model takes it from the position: an error
of the zero turns the field against the windings, and a short of one phase is then read as shorts of others,
with a small residual. But that residual has a direction (Rao 1948: a score test): that of the derivative by
the rotor's zero.
"""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.diagnosis.explanation.refits import left_by_descents
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.uncertainty.partial_regression import size_of_one
from emaphm.random_streams import stream


@dataclass(frozen=True)
class RotorZeroSettings:
    """From when on another zero contradicts an estimate; `make study` (spoilt) measures it.

    An error above `least` [rad, electrical] and `score` standard errors, with which `descents` leave less
    than `share` of the mean squared residual. Ten recordings whose zero was right had 0.002 rad and 1.5
    standard errors at most, but for healthy windings, where none shows; six with one 2 rad off, which is 0.09
    rad off for another phase, 0.05 to 0.08 rad and 5 to 31. `step` is that of the derivative.
    """

    least: float = 0.02
    score: float = 3.0
    descents: int = 2
    share: float = 0.985
    step: float = 0.05


ROTOR_ZERO = RotorZeroSettings()


def contradicted_zero(result: SearchResult, jacobians: Array, seed: int) -> tuple[str, ...]:
    """Return why the rotor's zero contradicts the estimate, a sentence; nothing where it does not.

    Not asked where the rotor's angle was recorded. `jacobians`, (n, d, channel rows), are the estimate's.
    """
    objective = result.objective
    electrical = objective.problem.actuator.electrical
    if electrical is None or "angle_rad" in objective.problem.measured:
        return ()

    def turned(electrical_rad: float) -> MapObjective:
        return _with_rotor_at(objective, electrical_rad / electrical.pole_pairs)

    low, high = (
        turned(end).outputs(result.point[np.newaxis])[0, : objective.channel_rows]
        for end in (-ROTOR_ZERO.step, ROTOR_ZERO.step)
    )
    size, error = size_of_one(result, jacobians, (high - low) / (2 * ROTOR_ZERO.step))
    if abs(size) <= max(ROTOR_ZERO.least, ROTOR_ZERO.score * error):
        return ()
    as_described, elsewhere = (
        left_by_descents(
            result,
            one,
            result.outputs_correction,
            ROTOR_ZERO.descents,
            stream(seed, "descents with another zero of the rotor"),
        )
        for one in (objective, turned(size))
    )
    if elsewhere >= ROTOR_ZERO.share * as_described:
        return ()
    sentence = (
        f"the rotor's electrical zero seems to be {size:+.2g} rad from where the position's zero puts it, "
        "or that and a third of a turn; the faults, of one phase or another, would otherwise take it up: "
        "record angle_rad, or correct the zero of command and position"
    )
    return (sentence,)


def _with_rotor_at(objective: MapObjective, rotor_rad: float) -> MapObjective:
    """Return the objective whose rotor is `rotor_rad` farther from the position's zero."""
    problem = objective.problem
    start = replace(problem.start, rotor_offset=problem.start.rotor_offset + rotor_rad)
    return replace(objective, problem=replace(problem, start=start))
