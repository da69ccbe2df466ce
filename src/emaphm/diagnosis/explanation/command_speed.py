"""Check of a command that requires speeds far beyond the motor's: its unit is probably wrong."""

import numpy as np

from emaphm.actuator.laws import largest_speed
from emaphm.estimation.problem import Problem
from emaphm.recording.jumps import Jumps

BEYOND = 3.0
"""Multiple of the motor's largest speed that commands do not require, except in jumps."""

LEAST_SHARE = 0.25
"""Smallest share of moving rows above that speed, without jumps: a command in degrees has mostly such."""


def notes_on_command(problem: Problem) -> tuple[str, ...]:
    """Return a sentence on a command that the motor cannot follow by far; else nothing."""
    actuator = problem.actuator
    largest = largest_speed(actuator)
    command = problem.measured["command_rad"]
    jumps = Jumps.of(command, means=problem.driving.sampling == "mean")
    rates = np.abs(jumps.changes_between(command)) / problem.inputs.interval
    speeds = rates[rates > 0] / actuator.mechanics.gear_ratio
    if not speeds.size or float(np.mean(speeds > BEYOND * largest)) < LEAST_SHARE:
        return ()
    note = (
        f"command_rad requires motor speeds of up to {speeds.max():.3g} "
        f"{'m/s' if actuator.has_linear_motor else 'rad/s'}, and the motor reaches {largest:.3g} at most; "
        "check the unit of command_rad (degrees or milliradians instead of rad) and the gear ratio"
    )
    return (note,)


def with_command(reasons: tuple[str, ...], problem: Problem) -> tuple[str, ...]:
    """Return the `reasons` against a recording, with a note on a command that the motor cannot follow.

    With such a command no channel agrees with the model. Reasons that concern other sensors are therefore
    omitted; the size of the primary channel's residual is kept.
    """
    notes = notes_on_command(problem)
    if not notes:
        return reasons
    return (*notes, *(reason for reason in reasons if reason.startswith(f"{problem.primary}: the residual")))
