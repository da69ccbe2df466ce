"""Edge of the backlash at which the motor stands at the start of a recording, and rows that depend on it.

A motor that has moved carries the user at one edge of the gap and stands there when it stops. A model that
starts in the middle first crosses half the gap, which appears as additional or missing backlash. The side is
the direction of the last motion: the sign of the speed or, in a rest, of the current against friction,
because a shaft stops short of its command. The side is unknown if an unrecorded load may cause that current,
or if the motor has just reversed. It has an effect until the motor has reached the first edge and the
transient of the drive has settled.
"""

import math
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from emaphm.actuator import Faults
from emaphm.arrays import Array
from emaphm.estimation.driving_signals import DrivingSignals
from emaphm.estimation.problem import Problem
from emaphm.estimation.rows.first_rows import first_rows, rows_apart

SIDES = (-1.0, 1.0)
"""Position of the motor ahead of the user at the edges of the gap, relative to half the gap."""


@dataclass(frozen=True)
class FirstMotionSettings:
    """Settings of the part of a motion that may be left out because its start is unknown.

    Models are compared with each other up to `longest` [s] after the first rest. The rows that remain must
    have the share `left` of the command's range; otherwise all rows are compared with the recording.
    """

    longest: float = 0.25
    left: float = 0.5


FIRST_MOTION = FirstMotionSettings()


def side_of(motion: float) -> float:
    """Return the edge of the gap at which a speed or torque holds the motor: 1 up, -1 down, 0 for none."""
    return float(np.sign(motion))


def at_side(problem: Problem, side: float) -> Problem:
    """Return the problem whose models start at a `side` of the gap."""
    return replace(problem, start=replace(problem.start, gap=side))


def shows_side(problem: Problem) -> bool:
    """Return whether the current of a rest shows the side: with a known load, the remainder is friction."""
    return "load_Nm" in problem.measured


def has_crossed_gap(problem: Problem, acceleration: float) -> bool:
    """Return whether the motor has moved by more than the widest gap since its last reversal.

    At the speed ω, it has moved by ω² / (2 α) with the command's `acceleration` α [rad/s²].
    """
    mechanics, scale = problem.actuator.mechanics, problem.actuator.faults.backlash
    widest = mechanics.backlash * (1 + scale)
    return problem.start.speed**2 >= 2 * abs(acceleration) / mechanics.gear_ratio * widest


def motion_after(problem: Problem, rest: int = 0, lead: int = 0) -> DrivingSignals:
    """Return the signals of the first motion after `rest` rows of rest, preceded by `lead` rows of it."""
    interval = problem.inputs.interval
    rows = min(problem.samples - rest, math.ceil(FIRST_MOTION.longest / interval))
    return problem.driving.beginning((rest - lead) * interval, lead + rows)


def leaves_enough(problem: Problem, rows: int) -> bool:
    """Return whether enough motion remains without the first `rows`."""
    command = problem.measured["command_rad"]
    remaining = float(np.ptp(command[rows:])) if rows < problem.samples else 0.0
    return remaining > 0 and remaining >= FIRST_MOTION.left * float(np.ptp(command))


def rows_of_unknown_side(problem: Problem, driving: DrivingSignals) -> int:
    """Return the number of first rows in which models differ that start at either edge of the gap.

    They are averaged models from the start of the `problem`, over the `driving` signals, for likely widths of
    the gap.
    """
    faults = _likely_faults()
    at_edges = [at_side(problem, side) for side in SIDES]
    return rows_apart(problem, [first_rows(edge, driving, edge.start.angle, faults) for edge in at_edges])


def _likely_faults() -> Array:
    """Return fault vectors (n, 8) that change the width of the gap and the time of crossing it."""
    return np.array(
        [
            Faults(backlash=backlash, friction=friction).vector
            for backlash, friction in product((0.0, 0.5), (0.0, 0.5))
        ]
    )
