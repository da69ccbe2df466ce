"""Rests of the shaft during a recording, and the random part of the channels' means in them."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array, Flags, runs
from emaphm.estimation.discrepancy import REFERENCE_RUNS, runs_about, with_all_phases
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.problem import Problem
from emaphm.estimation.rests import Rests
from emaphm.recording.noise import measured_noise, noise_level

LEAST_REST_S = 20e-3
"""Shortest rest that is considered [s]; the long-run covariance includes correlation over shorter times."""

TINY: float = float(np.finfo(float).tiny) ** 0.25
"""Lower limit of the noise, so that the inverse of its square is finite."""

STILL = 0.01
"""Change of the command, relative to its range, up to which the command counts as standing."""


def with_rests(
    objective: MapObjective, point: Array, reference: Problem, rng: np.random.Generator
) -> MapObjective:
    """Return the objective without the random part of the channels' means in the rests at `point` (d,).

    The objective is returned unchanged if its rests are known already, if the shaft has no rest, or if the
    drive has no hysteresis, whose switching causes the random part. `reference` is the problem of the
    reference model; `rng` draws the separations of its runs.
    """
    problem = objective.problem
    if problem.rests is not None or problem.actuator.drive_kind != "hysteresis":
        return objective
    if not command_stands(problem):
        return objective
    least = LEAST_REST_S / problem.inputs.interval
    intervals = runs(_standing_rows(objective, point, reference))
    bounds = np.array([(first, after) for first, after in intervals if after - first >= least])
    if not bounds.size:
        return objective
    outputs = runs_about(objective, point[np.newaxis], with_all_phases(reference), rng, REFERENCE_RUNS)[0]
    rows = outputs[:, : objective.channel_rows].reshape(len(outputs), len(problem.channels), -1)
    rows /= problem.weights[:, np.newaxis]
    noise = np.array([_noise(problem, name, rows[:, i]) for i, name in enumerate(problem.channels)])
    every = np.zeros(problem.samples, bool)
    is_compared = ~np.array([problem.unusable.get(name, every) for name in problem.channels])
    compared = np.array([is_compared[:, first:after].sum(axis=1) for first, after in bounds])
    rests = Rests.of(bounds, _patterns(rows * is_compared, bounds, compared, noise), noise, compared)
    return replace(objective, problem=replace(problem, rests=rests))


def command_stands(problem: Problem) -> bool:
    """Return whether the command stands after it has moved: otherwise no run is needed to find a rest.

    A rest before the first motion has no random part, because all runs begin with the same state.
    """
    command = problem.driving.command(np.arange(problem.samples, dtype=float) * problem.inputs.interval)
    still = float(np.ptp(command)) * STILL
    after = command[int(np.argmax(np.abs(command - command[0]) > still)) :]
    rows = math.ceil(LEAST_REST_S / problem.inputs.interval)
    if still == 0.0 or rows > after.size:
        return False
    # Between equal ends of a window, the command may have moved: the range of the window decides.
    ends = np.flatnonzero(np.abs(after[rows - 1 :] - after[: after.size - rows + 1]) <= still)
    windows = np.lib.stride_tricks.sliding_window_view(after, rows)[ends]
    return bool((np.ptp(windows, axis=1) <= still).any())


def _standing_rows(objective: MapObjective, point: Array, reference: Problem) -> Flags:
    """Return the rows in which the shaft of the `reference` model stands at `point` (d,), (samples,).

    The shaft of the fitted model only creeps: without switching it does not overshoot the position at which
    friction would hold it.
    """
    points = point[np.newaxis]
    faults, parameters = objective.space.faults(points), objective.lumped_parameters(points)
    return np.asarray(reference.exact(faults, parameters, ("speed_rad_s",))[0, 0] == 0.0)


def _noise(problem: Problem, channel: str, outputs: Array) -> float:
    """Return the rms of the white noise in a row of a `channel`: of its sensor, or of switching if larger."""
    of_sensor = measured_noise(problem.measured[channel], problem.inputs.interval)
    return max(of_sensor, float(np.median([noise_level(run) for run in outputs])), TINY)


def _patterns(outputs: Array, bounds: NDArray[np.intp], compared: NDArray[np.intp], noise: Array) -> Array:
    """Return the largest principal component of the means of each rest over n runs, (k, channels).

    `outputs`, (n, channels, rows), are those of the runs, 0 in rows that are not compared; `compared` are the
    numbers of compared rows, (k, channels). One direction of the channels per rest is enough, because a
    single variable, the position error, causes the deviations of all channels.
    """
    patterns = np.zeros((len(bounds), outputs.shape[1]))
    for k, (first, after) in enumerate(bounds):
        means = outputs[:, :, first:after].sum(axis=2) / np.maximum(compared[k], 1)
        _, sizes, axes = np.linalg.svd((means - means.mean(axis=0)) / noise, full_matrices=False)
        patterns[k] = axes[0] * sizes[0] / np.sqrt(len(outputs) - 1) * noise
    return patterns
