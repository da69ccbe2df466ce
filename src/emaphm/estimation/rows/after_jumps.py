"""Rows right after a jump of the command, which depend on the unknown time at which the drive reads it.

A drive with pulse-width modulation reads its command once per period, at a time that the recording does not
contain. The current may rise by 10 A in a millisecond: due to the unknown time, the model deviates from the
rows after a jump by many times the noise.
"""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.actuator import Command, Faults
from emaphm.arrays import Array
from emaphm.estimation.problem import Problem
from emaphm.estimation.signal_size import signal_size
from emaphm.recording.jumps import Jumps
from emaphm.recording.noise import noise_on_most_rows
from emaphm.recording.sensor_checks.resolution import Mask


@dataclass(frozen=True)
class JumpRowsSettings:
    """Settings of the rows that are not compared.

    A row is not compared if a shift of the jump by half a period changes a channel by more than `noise` times
    its noise and by more than `share` of its rms. If more than the share `most` of all rows is affected, all
    rows are compared.
    """

    noise: float = 1.0
    share: float = 5e-3
    most: float = 0.25


JUMP_ROWS = JumpRowsSettings()


def rows_after_jumps(problem: Problem) -> dict[str, Mask]:
    """Return by channel the rows (samples,) that are not compared because the time of a jump is uncertain.

    They are the rows in which the model of a healthy actuator differs between the recorded jumps and jumps
    half a period of the modulation later. No rows are left out if rows are instants: a jump may then be
    anywhere between two rows, but is assumed to be at a row.
    """
    driving, drive = problem.driving, problem.actuator.drive
    if drive is None or drive.pwm_frequency is None or driving.sampling == "instant":
        return {}
    if not Jumps.of(problem.measured["command_rad"], means=True).before.size:
        return {}
    half = 0.5 / drive.pwm_frequency
    step = min(problem.model.step_for(problem.actuator), half)
    earlier, later = (_outputs(problem, _delayed(driving.command, delay), step) for delay in (0.0, half))
    masks = {}
    for name, change in zip(problem.channels, np.abs(later - earlier), strict=True):
        values = problem.measured[name]
        noise = noise_on_most_rows(values)
        by_noise = JUMP_ROWS.noise * max(noise, problem.counts.get(name, 0.0))
        least = max(by_noise, JUMP_ROWS.share * signal_size(name, values))
        mask = change > least
        if mask.any() and mask.mean() <= JUMP_ROWS.most:
            masks[name] = mask
    return masks


def _delayed(command: Command, time: float) -> Command:
    """Return `command` delayed by `time` [s]."""
    return lambda times: command(times - time)


def _outputs(problem: Problem, command: Command, step: float) -> Array:
    """Return the channels (channels, samples) of a healthy actuator under another command."""
    inputs = replace(problem.driving, command=command).inputs(step)
    return np.asarray(replace(problem, inputs=inputs).predict(Faults().vector[np.newaxis])[0])
