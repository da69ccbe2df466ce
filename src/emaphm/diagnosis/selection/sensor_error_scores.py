"""Derivatives with respect to sensor errors."""

from collections.abc import Mapping

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.finite_differences import replicated_jacobians
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.sensors.sensor_model import sensor_error
from emaphm.estimation.space.parameter_space import Box
from emaphm.estimation.uncertainty.local_covariance import JACOBIAN_STEP, REPLICATES


def jacobians_with_errors(
    objective: MapObjective, point: Array, rng: np.random.Generator, known: Mapping[str, Array]
) -> Array:
    """Return replicated Jacobians (n, d, channel rows) about `point` (d,); sensor errors are not replicated.

    Outputs are linear in sensor errors, without kinks: one central difference is used for all replicates.
    `known` are derivatives (n, channel rows) that need no simulation, by coordinate.
    """
    coordinates = objective.space.coordinates
    errors = [i for i, name in enumerate(coordinates) if sensor_error(name)]
    others = [i for i, name in enumerate(coordinates) if i not in errors and name not in known]

    def outputs(points: Array) -> Array:
        return objective.outputs(points)[:, : objective.channel_rows]

    def outputs_of_others(points: Array) -> Array:
        complete = np.tile(point, (len(points), 1))
        complete[:, others] = points
        return outputs(complete)

    result = np.empty((REPLICATES, len(coordinates), objective.channel_rows))
    for name, derivatives in known.items():
        result[:, coordinates.index(name)] = derivatives
    if others:
        box = Box(objective.space.lower[others], objective.space.upper[others])
        result[:, others] = replicated_jacobians(
            outputs_of_others, point[others], box, JACOBIAN_STEP, REPLICATES, rng
        )
    if errors:
        steps = JACOBIAN_STEP * np.eye(len(coordinates))[errors]
        outputs_at_steps = outputs(np.concatenate([point + steps, point - steps]))
        result[:, errors] = (outputs_at_steps[: len(errors)] - outputs_at_steps[len(errors) :]) / (
            2 * JACOBIAN_STEP
        )
    return result
