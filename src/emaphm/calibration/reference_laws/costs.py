"""What the reference model leaves of a calibration's recordings, for laws that the averaged one hides."""

import math
from collections.abc import Sequence

import numpy as np

from emaphm.arrays import Array
from emaphm.calibration.held_out import subset
from emaphm.errors import MethodError
from emaphm.estimation.joint.correction import compared
from emaphm.estimation.joint.objective import JointObjective

RECORDINGS = 3
"""How many are compared, the shortest: a reference run takes a twentieth of a recording's time."""


def reference_costs(joint: JointObjective, points: Sequence[Array], seed: int) -> list[float]:
    """Return the mean squared residual of the reference model's primary channel at each of `points` (d,).

    Infinite at all of them where one needs shorter steps than the model's.
    """
    lengths = [term.objective.problem.duration_s for term in joint.terms]
    kept = sorted(range(len(lengths)), key=lambda r: lengths[r])[:RECORDINGS]
    parts = [subset(joint, point, kept) for point in points]
    try:
        outcomes = compared(parts[0][0], np.array([one for _, one in parts]), seed, "shaft")
    except MethodError:  # a shaft so stiff or damped that the step is too long for it
        return [math.inf for _ in points]
    return [one.primary_variance for one in outcomes]
