"""What models show in the first rows of a recording, from one start or another, and what counts there."""

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
"""Difference that counts in a channel, over its noise."""

SHARE = 5e-3
"""Least difference that counts in a channel, over its rms."""

FORGOTTEN_S = 20e-3
"""Time without a difference after which a start is forgotten [s]."""


def likely_faults(problem: Problem) -> Array:
    """Return fault vectors (n, 8) that change how the actuator follows, and the size of its channels."""
    return _likely_faults(has_windings=problem.actuator.electrical is not None)


@cache
def _likely_faults(*, has_windings: bool) -> Array:
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
    """Return the channels (n, channels, rows) of the averaged model that starts at the motor's `angle` [rad].

    It is driven over as many rows as the `driving` signals have. Where `channels` are left out, they are
    those that are compared. These runs are not of the whole recording, and do not count as simulations of it.
    """
    inputs = driving.inputs(AVERAGED.step_for(problem.actuator))
    start = replace(problem.start, angle=angle)
    short = replace(problem, model=AVERAGED, inputs=inputs, start=start, runs=RunCounts())
    return short.predict(faults, channels=channels)


def rows_apart(problem: Problem, outputs: list[Array]) -> int:
    """Return the rows in which `outputs` (n, channels, rows) of several starts differ, 0 where they never do.

    By more than the noise of a channel and more than a share of its size, for any of the n faults. Where they
    have not differed for a while the start is forgotten: at a rest after the motion friction may hold one
    shaft here and another there, which is chance (`emaphm.estimation.rests`).
    """
    distances = np.max([np.abs(one - outputs[0]) for one in outputs[1:]], axis=(0, 1))
    apart = (distances > _least_difference(problem)[:, np.newaxis]).any(axis=0)
    differing = np.flatnonzero(apart)
    if not differing.size:
        return 0
    forgotten = np.flatnonzero(np.diff(differing) * problem.inputs.interval > FORGOTTEN_S)
    return int(differing[forgotten[0]] if forgotten.size else differing[-1]) + 1


def least_residual(problem: Problem, outputs: Array, first: int, count: int) -> float:
    """Return the least rms residual of n models over `count` rows from the `first` on.

    `outputs` are their channels (n, channels, rows), from the `first` row on as well; each channel counts in
    parts of its size.
    """
    measured = np.stack([problem.measured[name][first : first + count] for name in problem.channels])
    residuals = (outputs[:, :, :count] - measured) * _shares(problem)[:, np.newaxis]
    return float(np.sqrt(np.mean(residuals**2, axis=(1, 2)).min()))


def longest_delay(problem: Problem) -> float:
    """Return by how much the described sensors of the channels are late, at most [s]."""
    return max(float(problem.actuator.sensors.of(name).delay) for name in problem.channels)


def noise_residual(problem: Problem) -> float:
    """Return what the noise alone leaves as `least_residual`."""
    return float(np.sqrt(np.mean((_noise(problem) * _shares(problem)) ** 2)))


def _shares(problem: Problem) -> Array:
    """Return what takes each channel to parts of its size, (channels,): 0 where it is constant."""
    sizes = _sizes(problem)
    return np.divide(1.0, sizes, out=np.zeros_like(sizes), where=sizes > 0)


def _sizes(problem: Problem) -> Array:
    """Return the size of each channel, in its unit, (channels,)."""
    return np.array([signal_size(name, problem.measured[name]) for name in problem.channels])


def _least_difference(problem: Problem) -> Array:
    """Return the difference that counts in each channel, in its unit, (channels,)."""
    return np.maximum(NOISE * _noise(problem), SHARE * _sizes(problem))


def _noise(problem: Problem) -> Array:
    """Return the noise of each channel, or its step where that is larger, in its unit, (channels,)."""
    return np.array(
        [
            max(noise_on_most_rows(problem.measured[name]), problem.counts.get(name, 0.0))
            for name in problem.channels
        ]
    )
