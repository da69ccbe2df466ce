"""The error common to all recordings of a unit, against estimates of many units by linear models."""

import math

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.actuator.unit.tolerances import Tolerances
from emaphm.arrays import Array
from emaphm.estimation.uncertainty.shared_error import shared_covariance

UNIT = THESIS.model_copy(update={"tolerances": Tolerances(torque_constant=0.1, inertia=0.3)})
DEVIATIONS = np.log1p([0.1, 0.3]) / 2
COORDINATES = (*CARTESIAN_NAMES, "load", "baseline torque_constant", "baseline inertia")


def test_the_shared_covariance_is_that_between_two_recordings_of_a_unit() -> None:
    rng = np.random.default_rng(0)
    units, rows = 20_000, 40
    jacobian = rng.normal(size=(rows, len(COORDINATES)))
    jacobian[:, -2:] *= [5.0, 0.5]  # a recording identifies the first deviation well and the second poorly
    noise = 0.3
    precision = jacobian.T @ jacobian / noise**2
    precision[-2:, -2:] += np.diag(1 / DEVIATIONS**2)
    covariance: Array = np.linalg.inv(precision).astype(float)
    truth = np.zeros((units, len(COORDINATES)))
    truth[:, -2:] = DEVIATIONS * rng.standard_normal((units, 2))

    def errors() -> Array:
        recorded = truth @ jacobian.T + noise * rng.standard_normal((units, rows))
        return np.asarray((recorded @ jacobian / noise**2 @ covariance - truth)[:, :8], float)

    first, second = errors(), errors()
    shared = shared_covariance(UNIT, COORDINATES, covariance, {})
    assert shared is not None
    scatter = np.sqrt(np.outer(np.diag(covariance)[:8], np.diag(covariance)[:8]))
    np.testing.assert_allclose(
        first.T @ second / units / scatter, shared / scatter, atol=4 / math.sqrt(units)
    )
    np.testing.assert_allclose(
        first.T @ first / units / scatter, covariance[:8, :8] / scatter, atol=6 / math.sqrt(units)
    )


def test_the_shared_covariance_does_not_exceed_the_whole_covariance() -> None:
    covariance = np.eye(len(COORDINATES)) * 1e-4
    covariance[-1, 0] = covariance[0, -1] = 5e-4  # impossible for a posterior
    covariance[-1, -1] = DEVIATIONS[1] ** 2
    shared = shared_covariance(UNIT, COORDINATES, covariance, {})
    assert shared is not None
    eigenvalues = np.linalg.eigvalsh(covariance[:8, :8] - shared)
    assert eigenvalues.min() >= -1e-12


def test_a_component_known_exactly_has_no_shared_error() -> None:
    covariance = np.diag([1e-4] * 9 + list(DEVIATIONS**2))
    covariance[1, -1] = covariance[-1, 1] = 5e-4
    expected = covariance[1, -1] ** 2 / DEVIATIONS[1] ** 2
    covariance[0] = covariance[:, 0] = 0.0
    shared = shared_covariance(UNIT, COORDINATES, covariance, {})
    assert shared is not None
    np.testing.assert_allclose(shared, np.diag([0.0, expected] + [0.0] * 6), atol=1e-18)


@pytest.mark.parametrize("coordinates", [COORDINATES[:-2], ()])
def test_a_unit_without_tolerances_has_no_shared_error(coordinates: tuple[str, ...]) -> None:
    assert shared_covariance(THESIS, coordinates, np.eye(len(coordinates)), {}) is None
