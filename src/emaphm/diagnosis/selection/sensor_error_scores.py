"""Derivatives with respect to sensor errors."""

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.finite_differences import replicated_jacobians
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.sensors.sensor_model import sensor_error
from emaphm.estimation.space.parameter_space import Box
from emaphm.estimation.uncertainty.local_covariance import JACOBIAN_STEP, REPLICATES


def jacobians_with_errors(objective: MapObjective, point: Array, rng: np.random.Generator) -> Array:
    """Return replicated Jacobians (n, d, channel rows) about `point` (d,); sensor errors are not replicated.

    Outputs are linear in sensor errors, without kinks: one central difference is used for all replicates.
    """
    coordinates = objective.space.coordinates
    errors = [i for i, name in enumerate(coordinates) if sensor_error(name)]
    others = [i for i in range(len(coordinates)) if i not in errors]

    def outputs(points: Array) -> Array:
        return objective.outputs(points)[:, : objective.channel_rows]

    def outputs_of_others(points: Array) -> Array:
        complete = np.tile(point, (len(points), 1))
        complete[:, others] = points
        return outputs(complete)

    box = Box(objective.space.lower[others], objective.space.upper[others])
    jacobians = replicated_jacobians(outputs_of_others, point[others], box, JACOBIAN_STEP, REPLICATES, rng)
    result = np.empty((REPLICATES, len(coordinates), objective.channel_rows))
    result[:, others] = jacobians
    if errors:
        steps = JACOBIAN_STEP * np.eye(len(coordinates))[errors]
        outputs_at_steps = outputs(np.concatenate([point + steps, point - steps]))
        result[:, errors] = (outputs_at_steps[: len(errors)] - outputs_at_steps[len(errors) :]) / (
            2 * JACOBIAN_STEP
        )
    return result
