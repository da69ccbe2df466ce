"""Where the shaft stands during a recording, and how much of what it shows there is chance."""

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
"""Shortest rest that is looked at [s]. Over less, the long-run covariance allows for what goes together."""

TINY: float = float(np.finfo(float).tiny) ** 0.25
"""Least noise, so that one over its square is finite."""

STILL = 0.01
"""Of its range, what the command may move by and still stands."""


def with_rests(
    objective: MapObjective, point: Array, reference: Problem, rng: np.random.Generator
) -> MapObjective:
    """Return the objective that leaves out what is chance where the shaft stands at `point` (d,).

    As it is where that is known already, the shaft stands nowhere, or the drive has no hysteresis, whose
    switching makes it so. `reference` is the problem of the reference model, and `rng` separates its runs.
    """
    problem = objective.problem
    if problem.rests is not None or problem.actuator.drive_kind != "hysteresis":
        return objective
    if not command_stands(problem):
        return objective
    least = LEAST_REST_S / problem.inputs.interval
    stretches = runs(_standing(objective, point, reference))
    bounds = np.array([(first, after) for first, after in stretches if after - first >= least])
    if not bounds.size:
        return objective
    outputs = runs_about(objective, point[np.newaxis], with_all_phases(reference), rng, REFERENCE_RUNS)[0]
    rows = outputs[:, : objective.channel_rows].reshape(len(outputs), len(problem.channels), -1)
    rows /= problem.weights[:, np.newaxis]
    noise = np.array([_noise(problem, name, rows[:, i]) for i, name in enumerate(problem.channels)])
    rests = Rests.of(bounds, _patterns(rows, bounds, noise), noise)
    return replace(objective, problem=replace(problem, rests=rests))


def command_stands(problem: Problem) -> bool:
    """Return whether the command has moved and then stands: else no run is worth a look for a rest.

    Before it moves nothing is chance: every run begins alike.
    """
    command = problem.driving.command(np.arange(problem.samples, dtype=float) * problem.inputs.interval)
    still = float(np.ptp(command)) * STILL
    after = command[int(np.argmax(np.abs(command - command[0]) > still)) :]
    rows = math.ceil(LEAST_REST_S / problem.inputs.interval)
    if still == 0.0 or rows > after.size:
        return False
    # Where the ends of a window agree, it may have moved between them.
    ends = np.flatnonzero(np.abs(after[rows - 1 :] - after[: after.size - rows + 1]) <= still)
    windows = np.lib.stride_tricks.sliding_window_view(after, rows)[ends]
    return bool((np.ptp(windows, axis=1) <= still).any())


def _standing(objective: MapObjective, point: Array, reference: Problem) -> Flags:
    """Return in which rows the shaft of the `reference` model stands at `point` (d,), (samples,).

    The fitted model's only creeps there: no switching drives it beyond where friction would hold it.
    """
    only = point[np.newaxis]
    faults, parameters = objective.space.faults(only), objective.lumped_parameters(only)
    return np.asarray(reference.exact(faults, parameters, ("speed_rad_s",))[0, 0] == 0.0)


def _noise(problem: Problem, channel: str, outputs: Array) -> float:
    """Return the rms of what is white in a row of a `channel`: of its sensor, and of switching."""
    of_sensor = measured_noise(problem.measured[channel], problem.inputs.interval)
    return max(of_sensor, float(np.median([noise_level(run) for run in outputs])), TINY)


def _patterns(outputs: Array, bounds: NDArray[np.intp], noise: Array) -> Array:
    """Return what the means of rests differ by most between runs, (k, channels).

    `outputs`, (n, channels, rows), are those of the runs. One direction of the channels for each rest: one
    number, the error of position, makes what all of them show.
    """
    patterns = np.zeros((len(bounds), outputs.shape[1]))
    for k, (first, after) in enumerate(bounds):
        means = outputs[:, :, first:after].mean(axis=2)
        _, sizes, axes = np.linalg.svd((means - means.mean(axis=0)) / noise, full_matrices=False)
        patterns[k] = axes[0] * sizes[0] / np.sqrt(len(outputs) - 1) * noise
    return patterns
