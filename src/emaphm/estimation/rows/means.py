"""Means over several rows, where the shaft gives: its swing has no information, and hides what has.

A shaft that hits the edges of its backlash swings with a phase that switching alone changes, so that
derivatives of single rows scatter more than they are large. Means over some swings have little of it, and
most of what faults do. On the limits page's compliant shaft, below 150 Hz a fault makes the larger part of
the current's change and the reference model's switching a tenth; above 300 Hz it is the other way round.
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
    """How many rows are averaged; `emaphm study run limits` (compliant shafts, calibrated) shows the effect.

    Rows are averaged over `interval` [s] at most, and at least `rows` remain. With the mild shaft described
    exactly, random faults had a median error of 1.5 % by rows of 0.2 ms, 1.1, 0.75 and 0.5 % by means over 1,
    2 and 4 ms (5, 5, 5 and 10 cases).
    """

    interval: float = 4e-3
    rows: int = 100


ROW_MEANS = RowMeansSettings()


def rows_of_a_mean(problem: Problem) -> int:
    """Return how many rows of `problem` are averaged: 1 with a rigid shaft, or where rows are instants.

    A mean of instants is not the mean over their interval that a model would be asked for.
    """
    if problem.actuator.transmission is None or problem.driving.sampling == "instant":
        return 1
    by_interval = int(ROW_MEANS.interval / problem.inputs.interval * (1 + 1e-9))
    return max(1, min(by_interval, problem.samples // ROW_MEANS.rows))


def over_swings(problem: Problem) -> Problem:
    """Return the problem in means over swings of its shaft, as it is where that is rigid.

    What drives the model is still known at every row; rows at the end that fill no mean are left out.
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
    """Return a note where means of a recording's rows are compared; none where its rows are."""
    count = problem.averaged_rows
    if count == 1:
        return ()
    over_ms = 1e3 * problem.inputs.interval
    why = "the shaft gives, and its swing hides faults"
    return (f"compared in means of {count} rows, over {over_ms:.3g} ms: {why}",)


def mean_rows(values: Array, count: int) -> Array:
    """Return the means of `count` rows each of `values` (n,), shape (n // count,)."""
    return np.asarray(values[: values.size // count * count].reshape(-1, count).mean(axis=1))


def masks_of_means(masks: Mapping[str, Mask], problem: Problem) -> dict[str, Mask]:
    """Return which rows of `problem` a mask (samples,) by channel of the recording's rows touches."""
    shape = problem.samples, problem.averaged_rows
    used = shape[0] * shape[1]
    return {name: np.asarray(mask[:used].reshape(shape).any(axis=1)) for name, mask in masks.items()}
