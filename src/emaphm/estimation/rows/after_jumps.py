"""Rows right after a jump of the command, whose moment is not known as exactly as they would show it.

A drive with pulse-width modulation reads its command once a period, and the recording does not say when.
Meanwhile the current may rise by 10 A in a millisecond: what follows a jump is right but for its moment, by
many times the noise.
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
    """Which rows are not compared.

    Where half of the period changes a channel by more than `noise` times its noise and than `share` of its
    rms, up to `most` of all rows: beyond, all are kept.
    """

    noise: float = 1.0
    share: float = 5e-3
    most: float = 0.25


JUMP_ROWS = JumpRowsSettings()


def rows_after_jumps(problem: Problem) -> dict[str, Mask]:
    """Return by channel the rows (samples,) that are not compared because a jump may be earlier or later.

    By the model of a healthy actuator, the jumps as recorded and half of a period of its modulation later.
    None where rows are instants, between which a jump may be anywhere, but is taken to be at a row.
    """
    driving, drive = problem.driving, problem.actuator.drive
    if drive is None or drive.pwm_frequency is None or driving.sampling == "instant":
        return {}
    if not Jumps.of(problem.measured["command_rad"], means=True).before.size:
        return {}
    half = 0.5 / drive.pwm_frequency
    step = min(problem.model.step_for(problem.actuator), half)
    earlier, later = (_outputs(problem, _late(driving.command, late), step) for late in (0.0, half))
    masks = {}
    for name, change in zip(problem.channels, np.abs(later - earlier), strict=True):
        values = problem.measured[name]
        noise = noise_on_most_rows(values)
        known = JUMP_ROWS.noise * max(noise, problem.counts.get(name, 0.0))
        least = max(known, JUMP_ROWS.share * signal_size(name, values))
        mask = change > least
        if mask.any() and mask.mean() <= JUMP_ROWS.most:
            masks[name] = mask
    return masks


def _late(command: Command, time: float) -> Command:
    return lambda times: command(times - time)


def _outputs(problem: Problem, command: Command, step: float) -> Array:
    """Return the channels (channels, samples) of a healthy actuator under another command."""
    inputs = replace(problem.driving, command=command).inputs(step)
    return np.asarray(replace(problem, inputs=inputs).predict(Faults().vector[np.newaxis])[0])
