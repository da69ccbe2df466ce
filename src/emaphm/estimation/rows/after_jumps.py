"""Rows right after a jump of the command, which depend on the unknown time at which the drive reads it.

A drive with pulse-width modulation reads its command once per period, at a time that the recording does not
contain. The current may rise by 10 A in a millisecond: due to the unknown time, the model deviates from the
rows after a jump by many times the noise.
"""

from dataclasses import replace

import numpy as np

from emaphm.actuator import Command, Faults
from emaphm.arrays import Array
from emaphm.estimation.problem import Problem
from emaphm.estimation.rows.first_rows import least_difference
from emaphm.recording.jumps import Jumps
from emaphm.recording.sensor_checks.resolution import Mask

MOST_SHARE = 0.25
"""Share of affected rows above which all rows are compared."""


def rows_after_jumps(problem: Problem) -> dict[str, Mask]:
    """Return by channel the rows (samples,) that are not compared because the time of a jump is uncertain.

    They are the rows in which the model of a healthy actuator differs significantly (`least_difference`)
    between the recorded jumps and jumps half a period of the modulation later. No rows are left out if rows
    are instants: a jump may then be anywhere between two rows, but is assumed to be at a row.
    """
    driving, drive = problem.driving, problem.actuator.drive
    if drive is None or drive.pwm_frequency is None or driving.sampling == "instant":
        return {}
    if not Jumps.of(problem.measured["command_rad"], means=True).before.size:
        return {}
    half = 0.5 / drive.pwm_frequency
    step = min(problem.model.step_for(problem.actuator), half)
    earlier, later = (_outputs(problem, _delayed(driving.command, delay), step) for delay in (0.0, half))
    significant = np.abs(later - earlier) > least_difference(problem)[:, np.newaxis]
    masks = zip(problem.channels, significant, strict=True)
    return {name: mask for name, mask in masks if mask.any() and mask.mean() <= MOST_SHARE}


def _delayed(command: Command, time: float) -> Command:
    """Return `command` delayed by `time` [s]."""
    return lambda times: command(times - time)


def _outputs(problem: Problem, command: Command, step: float) -> Array:
    """Return the channels (channels, samples) of a healthy actuator under another command."""
    inputs = replace(problem.driving, command=command).inputs(step)
    return np.asarray(replace(problem, inputs=inputs).predict(Faults().vector[np.newaxis])[0])
