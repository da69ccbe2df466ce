"""What slow rows leave open: the command between them."""

from dataclasses import replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.uncertainty.fisher_information import information


def step_by_other_command(
    objective: MapObjective, point: Array, residual: Array, jacobians: Array
) -> Array | None:
    """Return how far the estimate at `point` (d,) would move if another command lay behind the rows, (d,).

    A Gauss-Newton step by `jacobians` (n, d, channel rows) of a fit under the other curve that the rows of
    the command allow (`emaphm.recording.other_curve`), which makes up for what that changes of the model's
    outputs; None where rows are dense enough that there is none. `residual` (channel rows,) is its own.
    """
    problem, rows = objective.problem, objective.channel_rows
    if problem.driving.other_command is None:
        return None
    other = replace(problem.driving, command=problem.driving.other_command)
    inputs = other.inputs(problem.model.step_for(problem.actuator))
    under_other = replace(objective, problem=replace(problem, inputs=inputs))
    both = [one.outputs(point[np.newaxis])[0, :rows] for one in (objective, under_other)]
    variance = max(float(np.mean(residual**2)), np.finfo(float).tiny)
    precision = information(jacobians) / variance + np.diag(objective.space.prior_deviations**-2)
    gradient = jacobians.mean(axis=0) @ (both[0] - both[1]) / variance
    step = np.linalg.solve(precision, gradient)
    return np.asarray(objective.space.project(point + step) - point)
