"""Derivatives by errors of sensors."""

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.finite_differences import replicated_jacobians
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.sensors.sensor_model import sensor_error
from emaphm.estimation.space.parameter_space import Box
from emaphm.estimation.uncertainty.local_covariance import JACOBIAN_STEP, REPLICATES


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
        all_coordinates = np.tile(point, (len(points), 1))
        all_coordinates[:, others] = points
        return outputs(all_coordinates)

    rest = Box(objective.space.lower[others], objective.space.upper[others])
    jacobians = replicated_jacobians(of_others, point[others], rest, JACOBIAN_STEP, REPLICATES, rng)
    result = np.empty((REPLICATES, len(coordinates), objective.channel_rows))
    result[:, others] = jacobians
    if errors:
        moves = JACOBIAN_STEP * np.eye(len(coordinates))[errors]
        sides = outputs(np.concatenate([point + moves, point - moves]))
        result[:, errors] = (sides[: len(errors)] - sides[len(errors) :]) / (2 * JACOBIAN_STEP)
    return result
