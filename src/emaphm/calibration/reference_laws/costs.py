"""Residuals of the reference model in a calibration, for laws with little effect in the averaged model."""

import math
from collections.abc import Sequence

import numpy as np

from emaphm.arrays import Array
from emaphm.calibration.held_out import subset
from emaphm.errors import MethodError
from emaphm.estimation.joint.correction import compared
from emaphm.estimation.joint.objective import JointObjective

RECORDINGS = 3
"""Number of compared recordings, the shortest; a reference run takes 1/20 of a recording's duration."""


def reference_costs(joint: JointObjective, points: Sequence[Array], seed: int) -> list[float]:
    """Return the mean squared residual of the reference model's primary channel at each of `points` (d,).

    All are infinite if one of the points needs a step that is shorter than the model's.
    """
    lengths = [term.objective.problem.duration_s for term in joint.terms]
    shortest = sorted(range(len(lengths)), key=lambda r: lengths[r])[:RECORDINGS]
    parts = [subset(joint, point, shortest) for point in points]
    try:
        outcomes = compared(parts[0][0], np.array([start for _, start in parts]), seed, "shaft")
    except MethodError:  # the step is too long for a very stiff or strongly damped shaft
        return [math.inf for _ in points]
    return [outcome.primary_variance for outcome in outcomes]
