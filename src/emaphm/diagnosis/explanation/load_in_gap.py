"""Caution on a load that carries the user through the backlash, which a rigid shaft does not model."""

import numpy as np

from emaphm.estimation.problem import Problem

LEAST_ROWS = 0.05
"""Smallest share of rows in which the load has each direction."""

LEAST_LOAD = 0.1
"""Smallest load in each direction, relative to the actuator's static friction: noise is smaller."""


def load_reverses_in_gap(problem: Problem) -> tuple[str, ...]:
    """Return a note if the recorded load decides at which edge of the backlash the user is.

    Behind a rigid shaft, friction holds the user within the gap until the motor reaches the other edge. A
    load that exceeds this friction in both directions moves the user there first. In four recordings of an
    independent simulator with a backlash four times as wide, a rigid shaft had a backlash of 0, in intervals
    that excluded the truth, and one recording was explained; with a described shaft, all intervals hold.
    """
    actuator = problem.actuator
    mechanics = actuator.mechanics
    if actuator.transmission is not None or not mechanics.backlash or "load_Nm" not in problem.measured:
        return ()
    load = problem.measured["load_Nm"]
    least = max(mechanics.static_friction_user, LEAST_LOAD * mechanics.static_friction)
    if min(np.mean(load > least), np.mean(load < -least)) < LEAST_ROWS:
        return ()
    note = (
        "load_Nm reverses and moves the user through the backlash, which a rigid shaft does not model: a "
        "larger backlash may not be found; describe inertia_motor and inertia_user, and calibrate with "
        "--laws compliance"
    )
    return (note,)
