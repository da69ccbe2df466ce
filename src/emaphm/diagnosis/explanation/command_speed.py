"""A command that asks for speeds far beyond the motor's: a note on its unit where nothing is explained."""

import numpy as np

from emaphm.actuator.laws import largest_speed
from emaphm.estimation.problem import Problem

BEYOND = 3.0
"""Multiple of the motor's largest speed that no command is made for, but for its steps."""

LEAST_SHARE = 0.25
"""Share of the moving rows that ask for more: of a step it is a row, of degrees most of the motion."""


def notes_on_command(problem: Problem) -> tuple[str, ...]:
    """Return a sentence on a command that the motor could follow nowhere near, or none."""
    actuator = problem.actuator
    largest = largest_speed(actuator)
    rates = np.abs(np.diff(problem.measured["command_rad"])) / problem.inputs.interval
    speeds = rates[rates > 0] / actuator.mechanics.gear_ratio
    if not speeds.size or float(np.mean(speeds > BEYOND * largest)) < LEAST_SHARE:
        return ()
    note = (
        f"command_rad asks the motor for up to {speeds.max():.3g} "
        f"{'m/s' if actuator.has_linear_motor else 'rad/s'}, and {largest:.3g} are the most that it reaches; "
        "check the unit of command_rad, as degrees or milliradians for rad, and the gear ratio"
    )
    return (note,)


def with_command(reasons: tuple[str, ...], problem: Problem) -> tuple[str, ...]:
    """Return the `reasons` that a recording is not explained, next to a command that no motor could follow.

    Such a command leaves every channel unlike the model. What a reason says of another sensor is therefore
    left out; the size of the primary channel's residual stays.
    """
    notes = notes_on_command(problem)
    if not notes:
        return reasons
    return (*notes, *(one for one in reasons if one.startswith(f"{problem.primary}: the residual")))
