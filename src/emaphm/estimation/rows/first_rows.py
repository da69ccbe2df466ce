"""Outputs of models in the first rows of a recording from different starts, and their differences."""

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np

from emaphm.actuator import Faults
from emaphm.arrays import Array
from emaphm.estimation.driving_signals import DrivingSignals
from emaphm.estimation.problem import Problem
from emaphm.estimation.run_counts import RunCounts
from emaphm.estimation.signal_size import signal_size
from emaphm.recording.noise import noise_on_most_rows
from emaphm.simulation import AVERAGED

NOISE = 1.0
"""Significant difference in a channel, relative to its noise."""

SHARE = 5e-3
"""Least significant difference in a channel, relative to its rms."""

FORGOTTEN_S = 20e-3
"""Time without a difference after which the start no longer has an effect [s]."""


def likely_faults(problem: Problem) -> Array:
    """Return fault vectors (n, 8) that change the actuator's response and the size of its channels."""
    return _likely_faults(has_windings=problem.actuator.electrical is not None)


@cache
def _likely_faults(*, has_windings: bool) -> Array:
    """Return the fault vectors (n, 8) of `likely_faults`; with shorts if the actuator has windings."""
    shorts = (0.0, 0.2) if has_windings else (0.0,)
    return np.array(
        [
            Faults(friction=friction, gain=gain, short_a=short, short_b=short, short_c=short).vector
            for friction, gain, short in product((0.0, 0.5, 1.0), (0.5, 0.0, 1.0), shorts)
        ]
    )


def first_rows(
    problem: Problem,
    driving: DrivingSignals,
    angle: float,
    faults: Array,
    channels: tuple[str, ...] = (),
) -> Array:
    """Return the channels (n, channels, rows) of the averaged model from the motor's `angle` [rad] on.

    The rows are those of the `driving` signals; the default `channels` are the compared channels. These short
    runs are not counted as simulations of the recording.
    """
    inputs = driving.inputs(AVERAGED.step_for(problem.actuator))
    start = replace(problem.start, angle=angle)
    short = replace(problem, model=AVERAGED, inputs=inputs, start=start, runs=RunCounts())
    return short.predict(faults, channels=channels)


def rows_apart(problem: Problem, outputs: list[Array]) -> int:
    """Return the number of first rows in which `outputs` (n, channels, rows) of several starts differ.

    Outputs differ where the difference exceeds the noise of a channel and a share of its size, for any of the
    n faults; 0 if they never differ. After `FORGOTTEN_S` without a difference, the start no longer has an
    effect: in a rest after the motion, friction may hold the shafts at different positions, which is random
    (`emaphm.estimation.rests`).
    """
    distances = np.max([np.abs(later - outputs[0]) for later in outputs[1:]], axis=(0, 1))
    is_different = (distances > least_difference(problem)[:, np.newaxis]).any(axis=0)
    differing = np.flatnonzero(is_different)
    if not differing.size:
        return 0
    forgotten = np.flatnonzero(np.diff(differing) * problem.inputs.interval > FORGOTTEN_S)
    return int(differing[forgotten[0]] if forgotten.size else differing[-1]) + 1


def least_residual(problem: Problem, outputs: Array, first: int, count: int) -> float:
    """Return the least rms residual of n models over `count` rows from row `first` on.

    `outputs` are their channels (n, channels, rows), also from row `first` on; each channel is divided by its
    size.
    """
    measured = np.stack([problem.measured[name][first : first + count] for name in problem.channels])
    residuals = (outputs[:, :, :count] - measured) * _inverse_sizes(problem)[:, np.newaxis]
    return float(np.sqrt(np.mean(residuals**2, axis=(1, 2)).min()))


def longest_delay(problem: Problem) -> float:
    """Return the largest described delay of the channels' sensors [s]."""
    return max(float(problem.actuator.sensors.of(name).delay) for name in problem.channels)


def noise_residual(problem: Problem) -> float:
    """Return the `least_residual` that is due to noise alone."""
    return float(np.sqrt(np.mean((_noise(problem) * _inverse_sizes(problem)) ** 2)))


def _inverse_sizes(problem: Problem) -> Array:
    """Return the inverse size of each channel, (channels,); 0 for a constant channel."""
    sizes = _sizes(problem)
    return np.divide(1.0, sizes, out=np.zeros_like(sizes), where=sizes > 0)


def _sizes(problem: Problem) -> Array:
    """Return the size of each channel, in its unit, (channels,)."""
    return np.array([signal_size(name, problem.measured[name]) for name in problem.channels])


def least_difference(problem: Problem) -> Array:
    """Return the least significant difference in each channel, in its unit, (channels,)."""
    return np.maximum(NOISE * _noise(problem), SHARE * _sizes(problem))


def _noise(problem: Problem) -> Array:
    """Return the rms noise of each channel, or its count if that is larger, in its unit, (channels,)."""
    return np.array(
        [
            max(noise_on_most_rows(problem.measured[name]), problem.counts.get(name, 0.0))
            for name in problem.channels
        ]
    )
