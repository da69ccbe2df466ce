"""Derivatives by errors of sensors, and what a regression on them finds."""

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.finite_differences import replicated_jacobians
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.parameter_space import Box
from emaphm.estimation.problem import Problem
from emaphm.estimation.sensors.sensor_model import sensor_error
from emaphm.estimation.uncertainty.local_covariance import (
    JACOBIAN_STEP,
    REPLICATES,
    rounding_scores,
)
from emaphm.estimation.uncertainty.long_run_variance import long_run_covariance


def jacobians_with_errors(objective: MapObjective, point: Array, rng: np.random.Generator) -> Array:
    """Return replicated Jacobians (n, d, channel rows) about `point` (d,), those of sensors' errors once.

    These are linear in the model's signals, and have no kinks: one central difference serves all replicates.
    """
    coordinates = objective.space.coordinates
    errors = [i for i, name in enumerate(coordinates) if sensor_error(name)]
    others = [i for i in range(len(coordinates)) if i not in errors]

    def outputs(points: Array) -> Array:
        return objective.outputs(points)[:, : objective.channel_rows]

    def of_others(points: Array) -> Array:
        whole = np.tile(point, (len(points), 1))
        whole[:, others] = points
        return outputs(whole)

    rest = Box(objective.space.lower[others], objective.space.upper[others])
    jacobians = replicated_jacobians(of_others, point[others], rest, JACOBIAN_STEP, REPLICATES, rng)
    result = np.empty((REPLICATES, len(coordinates), objective.channel_rows))
    result[:, others] = jacobians
    if errors:
        moves = JACOBIAN_STEP * np.eye(len(coordinates))[errors]
        sides = outputs(np.concatenate([point + moves, point - moves]))
        result[:, errors] = (sides[: len(errors)] - sides[len(errors) :]) / (2 * JACOBIAN_STEP)
    return result


def regressed(
    mean: Array, derivatives: Array, residual: Array, problem: Problem
) -> tuple[Array, Array, Array]:
    """Return the step (d,) of the others, the sizes (p,) of p more coordinates, and their covariance (p, p).

    By regression of the `residual` (rows,) on the `derivatives` (p, rows) less what the other coordinates,
    whose `mean` Jacobian is (d, rows), explain of them (Frisch and Waugh 1933); the scores are as correlated
    as the sandwich covariance takes them, with what counts of the channels of `problem` leave open.
    """
    normal = mean @ mean.T
    # An actuator that stands may answer to nothing at all.
    smallest = float(np.finfo(float).tiny)
    ridge = (1e-9 * float(np.trace(normal)) + smallest) * np.eye(len(normal))
    shares = np.linalg.solve(normal + ridge, mean @ derivatives.T)
    alone = derivatives - shares.T @ mean
    tiny = smallest * np.eye(len(alone))
    inverse = np.linalg.inv(alone @ alone.T + tiny)
    sizes = inverse @ (alone @ residual)
    scores = alone * (residual - sizes @ alone)
    scatter = long_run_covariance(scores, len(problem.channels)) + rounding_scores(problem, alone) + tiny
    return -(shares @ sizes), sizes, inverse @ scatter @ inverse
