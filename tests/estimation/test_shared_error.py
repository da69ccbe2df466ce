"""The error that all recordings of a unit share, against estimates of many units by linear models."""

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


def test_two_recordings_of_a_unit_are_off_by_as_much_as_they_share() -> None:
    rng = np.random.default_rng(0)
    units, rows = 20_000, 40
    jacobian = rng.normal(size=(rows, len(COORDINATES)))
    jacobian[:, -2:] *= [5.0, 0.5]  # of one deviation a recording says much, of the other little
    noise = 0.3
    precision = jacobian.T @ jacobian / noise**2
    precision[-2:, -2:] += np.diag(1 / DEVIATIONS**2)
    covariance: Array = np.linalg.inv(precision).astype(float)
    truth = np.zeros((units, len(COORDINATES)))
    truth[:, -2:] = DEVIATIONS * rng.standard_normal((units, 2))

    def errors() -> Array:
        recorded = truth @ jacobian.T + noise * rng.standard_normal((units, rows))
        return np.asarray((recorded @ jacobian / noise**2 @ covariance - truth)[:, :8], float)

    one, other = errors(), errors()
    shared = shared_covariance(UNIT, COORDINATES, covariance, {})
    assert shared is not None
    scatter = np.sqrt(np.outer(np.diag(covariance)[:8], np.diag(covariance)[:8]))
    np.testing.assert_allclose(one.T @ other / units / scatter, shared / scatter, atol=4 / math.sqrt(units))
    np.testing.assert_allclose(
        one.T @ one / units / scatter, covariance[:8, :8] / scatter, atol=6 / math.sqrt(units)
    )


def test_it_is_no_more_than_the_whole() -> None:
    covariance = np.eye(len(COORDINATES)) * 1e-4
    covariance[-1, 0] = covariance[0, -1] = 5e-4  # no posterior has that
    covariance[-1, -1] = DEVIATIONS[1] ** 2
    shared = shared_covariance(UNIT, COORDINATES, covariance, {})
    assert shared is not None
    left = np.linalg.eigvalsh(covariance[:8, :8] - shared)
    assert left.min() >= -1e-12


def test_what_is_known_exactly_shares_nothing() -> None:
    covariance = np.diag([1e-4] * 9 + list(DEVIATIONS**2))
    covariance[1, -1] = covariance[-1, 1] = 5e-4
    expected = covariance[1, -1] ** 2 / DEVIATIONS[1] ** 2
    covariance[0] = covariance[:, 0] = 0.0
    shared = shared_covariance(UNIT, COORDINATES, covariance, {})
    assert shared is not None
    np.testing.assert_allclose(shared, np.diag([0.0, expected] + [0.0] * 6), atol=1e-18)


@pytest.mark.parametrize("coordinates", [COORDINATES[:-2], ()])
def test_a_unit_that_is_as_described_shares_nothing(coordinates: tuple[str, ...]) -> None:
    assert shared_covariance(THESIS, coordinates, np.eye(len(coordinates)), {}) is None
