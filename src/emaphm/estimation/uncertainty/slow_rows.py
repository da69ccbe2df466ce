"""Uncertainty of an estimate due to the unknown command between slow rows."""

from dataclasses import replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.uncertainty.fisher_information import information


def step_by_other_command(
    objective: MapObjective, point: Array, residual: Array, jacobians: Array
) -> Array | None:
    """Return the change (d,) of the estimate at `point` (d,) under another command through the same rows.

    It is a Gauss-Newton step with `jacobians` (n, d, channel rows) that compensates the change of the model's
    outputs under the other curve through the rows of the command (`emaphm.recording.other_curve`). None if
    rows are so dense that there is no other curve. `residual` (channel rows,) is that of the estimate.
    """
    problem, rows = objective.problem, objective.channel_rows
    if problem.driving.other_command is None:
        return None
    other = replace(problem.driving, command=problem.driving.other_command)
    inputs = other.inputs(problem.model.step_for(problem.actuator))
    under_other = replace(objective, problem=replace(problem, inputs=inputs))
    outputs, other_outputs = (
        version.outputs(point[np.newaxis])[0, :rows] for version in (objective, under_other)
    )
    variance = max(float(np.mean(residual**2)), np.finfo(float).tiny)
    precision = information(jacobians) / variance + np.diag(objective.space.prior_deviations**-2)
    gradient = jacobians.mean(axis=0) @ (outputs - other_outputs) / variance
    step = np.linalg.solve(precision, gradient)
    return np.asarray(objective.space.project(point + step) - point)
