"""At which edge of the backlash the motor stands as a recording begins, and rows that depend on it.

A motor that has moved carries the user at one edge of the gap, and stands there when it stops: a model that
starts in the middle crosses half of the gap first, which reads as backlash that is not there, or hides what
is. The direction of the last motion is the side: that of the speed, or, at a rest, of the current that the
drive draws against friction, as a shaft stops short of its command. Where a load that was not recorded may
draw that current, or the motor has just turned, the side is not known. It matters until the motor has
reached the first edge, and its drive has forgotten the way there.
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
"""Shares of half of the gap by which the motor is ahead of the user, at its edges."""


@dataclass(frozen=True)
class FirstMotionSettings:
    """How much of the motion may be left out because its start is not known.

    Rows are compared between models up to `longest` [s] after the first rest. The share `left` of the
    command's range must follow, or all is compared.
    """

    longest: float = 0.25
    left: float = 0.5


FIRST_MOTION = FirstMotionSettings()


def side_of(motion: float) -> float:
    """Return at which edge of the gap a speed or torque holds the motor: 1 up, -1 down, 0 for none."""
    return float(np.sign(motion))


def at_side(problem: Problem, side: float) -> Problem:
    """Return the problem whose models start at a `side` of the gap."""
    return replace(problem, start=replace(problem.start, gap=side))


def shows_side(problem: Problem) -> bool:
    """Return whether the current of a rest shows the side: what it does not owe to the load is friction's."""
    return "load_Nm" in problem.measured


def has_crossed_gap(problem: Problem, acceleration: float) -> bool:
    """Return whether the motor, at its speed, has moved by more than the widest gap since it last turned.

    At the command's `acceleration` [rad/s²] it has moved by ω² / (2 α).
    """
    mechanics, scale = problem.actuator.mechanics, problem.actuator.faults.backlash
    widest = mechanics.backlash * (1 + scale)
    return problem.start.speed**2 >= 2 * abs(acceleration) / mechanics.gear_ratio * widest


def motion_after(problem: Problem, rest: int = 0, lead: int = 0) -> DrivingSignals:
    """Return the signals of the first motion after the `rest` rows, with `lead` rows of the rest before."""
    interval = problem.inputs.interval
    rows = min(problem.samples - rest, math.ceil(FIRST_MOTION.longest / interval))
    return problem.driving.beginning((rest - lead) * interval, lead + rows)


def leaves_enough(problem: Problem, rows: int) -> bool:
    """Return whether enough motion follows the first `rows` to do without them."""
    command = problem.measured["command_rad"]
    left = float(np.ptp(command[rows:])) if rows < problem.samples else 0.0
    return left > 0 and left >= FIRST_MOTION.left * float(np.ptp(command))


def rows_of_unknown_side(problem: Problem, driving: DrivingSignals) -> int:
    """Return the rows of the `driving` signals in which models differ that start at either edge of the gap.

    By the averaged model from where the `problem` starts, for likely widths of the gap.
    """
    faults = _likely_faults()
    sides = [at_side(problem, side) for side in SIDES]
    return rows_apart(problem, [first_rows(one, driving, one.start.angle, faults) for one in sides])


def _likely_faults() -> Array:
    """Return fault vectors (n, 8) that change how wide the gap is, and how soon it is crossed."""
    return np.array(
        [
            Faults(backlash=backlash, friction=friction).vector
            for backlash, friction in product((0.0, 0.5), (0.0, 0.5))
        ]
    )
