"""Means over several rows for a compliant shaft, whose oscillation hides the effect of faults.

A shaft that hits the edges of its backlash oscillates with a phase that depends on switching alone: the
scatter of the derivatives of single rows exceeds the derivatives. Means over some oscillations contain little
of it and most of the effect of faults. With the compliant shaft of the limits page, a fault causes most of
its change of the current below 150 Hz, and the reference model's switching a tenth; above 300 Hz the opposite
holds.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.problem import Problem
from emaphm.estimation.signal_size import signal_size
from emaphm.estimation.uncertainty.model_error import row_errors
from emaphm.recording.sensor_checks.resolution import Mask


@dataclass(frozen=True)
class RowMeansSettings:
    """Settings of the means; `emaphm study run limits` (compliant shafts, calibrated) measures their effect.

    Rows are averaged over at most `interval` [s], and at least `rows` means remain. With an exact description
    of the mild shaft, random faults had a median error of 1.5 % with rows of 0.2 ms, and of 1.1, 0.75 and
    0.5 % with means over 1, 2 and 4 ms (5, 5, 5 and 10 cases).
    """

    interval: float = 4e-3
    rows: int = 100


ROW_MEANS = RowMeansSettings()


def rows_of_a_mean(problem: Problem) -> int:
    """Return the number of rows per mean of `problem`: 1 for a rigid shaft, or if rows are instants.

    A mean of instants differs from the mean over their interval, which the model would be evaluated for.
    """
    if problem.actuator.transmission is None or problem.driving.sampling == "instant":
        return 1
    by_interval = int(ROW_MEANS.interval / problem.inputs.interval * (1 + 1e-9))
    return max(1, min(by_interval, problem.samples // ROW_MEANS.rows))


def over_swings(problem: Problem) -> Problem:
    """Return the problem in means over oscillations of its shaft; unchanged for a rigid shaft.

    The driving signals are still used at every row; rows at the end that do not fill a mean are left out.
    """
    count = rows_of_a_mean(problem)
    if count == 1:
        return problem
    driving = problem.driving
    longer = replace(driving, samples=driving.samples // count, interval=driving.interval * count)
    averaged = replace(
        problem,
        driving=longer,
        inputs=longer.inputs(problem.model.step_for(problem.actuator)),
        measured={name: mean_rows(values, count) for name, values in problem.measured.items()},
        model_error={},
        counts={},
        shared_errors={},
        averaged_rows=count,
    )
    averaged = replace(
        averaged,
        model_error=row_errors(averaged),
        unusable=masks_of_means(problem.unusable, averaged),
    )
    return averaged.weighted([signal_size(name, averaged.measured[name]) for name in averaged.channels])


def notes_on_means(problem: Problem) -> tuple[str, ...]:
    """Return a note if means of a recording's rows are compared, otherwise no note."""
    count = problem.averaged_rows
    if count == 1:
        return ()
    over_ms = 1e3 * problem.inputs.interval
    why = "the oscillation of the compliant shaft hides faults"
    return (f"compared in means of {count} rows, over {over_ms:.3g} ms: {why}",)


def mean_rows(values: Array, count: int) -> Array:
    """Return the means of `count` rows each of `values` (n,), shape (n // count,)."""
    return np.asarray(values[: values.size // count * count].reshape(-1, count).mean(axis=1))


def masks_of_means(masks: Mapping[str, Mask], problem: Problem) -> dict[str, Mask]:
    """Return masks of the means of `problem` that contain a masked row of the recording, by channel."""
    shape = problem.samples, problem.averaged_rows
    used = shape[0] * shape[1]
    return {name: np.asarray(mask[:used].reshape(shape).any(axis=1)) for name, mask in masks.items()}
