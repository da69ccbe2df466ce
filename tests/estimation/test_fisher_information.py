"""Normal equations of Jacobians with errors: unchanged for identified parameters, and 0 for the others."""

import numpy as np
import pytest

from emaphm.estimation.uncertainty.fisher_information import normal_equations, products, steadied_information

ROWS, REPLICATES = 600, 8
TRUTH = np.array([0.3, -0.2])


HIDDEN = 30.0
"""Information of a parameter, no larger than the apparent information of the errors of its Jacobians."""


@pytest.fixture(scope="module")
def rng() -> np.random.Generator:
    return np.random.default_rng(5)


def test_exact_jacobians_give_the_usual_normal_equations(rng: np.random.Generator) -> None:
    jacobian = rng.normal(size=(3, ROWS))
    residual = rng.normal(size=ROWS)
    normal, gradient = normal_equations(
        np.tile(jacobian, (REPLICATES, 1, 1)), residual, np.array([1.0, 3.0, 0.1])
    )
    np.testing.assert_allclose(normal, jacobian @ jacobian.T, rtol=1e-9, atol=1e-9 * ROWS)
    np.testing.assert_allclose(gradient, jacobian @ residual, rtol=1e-9, atol=1e-9 * ROWS)


def test_jacobian_errors_of_a_parameter_without_effect_do_not_move_it(rng: np.random.Generator) -> None:
    # Two parameters with an effect on the rows and one without, each with errors of the same size.
    exact = np.concatenate([rng.normal(size=(2, ROWS)), np.zeros((1, ROWS))])
    residual = exact[:2].T @ TRUTH + rng.normal(0.0, 0.1, ROWS)
    steps, plain = [], []
    for _ in range(200):
        jacobians = exact + rng.normal(0.0, 0.3, (REPLICATES, 3, ROWS))
        normal, gradient = normal_equations(jacobians, residual, np.ones(3))
        prior = np.diag([0.0, 0.0, 1.0])
        steps.append(np.linalg.solve(normal + prior, gradient))
        plain.append(np.linalg.solve(normal + prior, jacobians.mean(axis=0) @ residual))
    # Errors are as often of one sign as of the other: the mean step is the truth.
    np.testing.assert_allclose(np.mean(steps, axis=0)[:2], TRUTH, atol=0.01)
    rms, rms_plain = (np.sqrt(np.mean(np.array(step)[:, 2] ** 2)) for step in (steps, plain))
    assert rms < 0.3 * rms_plain


def test_a_prior_does_not_dominate_where_jacobian_errors_hide_information(rng: np.random.Generator) -> None:
    exact = rng.normal(size=(3, ROWS))
    exact[2] *= (HIDDEN / ROWS) ** 0.5
    # The data give 0 for the third parameter; its prior, of precision 1, gives 1.
    residual, prior = exact[:2].T @ TRUTH, np.diag([0.0, 0.0, 1.0])
    steady, filtered = [], []
    for _ in range(200):
        jacobians = exact + rng.normal(0.0, 3.0, (REPLICATES, 3, ROWS))
        known = steadied_information(products(jacobians), np.ones(3)) + prior
        steady.append(np.linalg.solve(known, jacobians.mean(axis=0) @ residual + prior[2])[2])
        normal, gradient = normal_equations(jacobians, residual, np.ones(3))
        filtered.append(np.linalg.solve(normal + prior, gradient + prior[2])[2])
    # The optimum is 1 / (1 + HIDDEN).
    assert np.max(np.abs(steady)) < 0.5
    assert np.max(np.abs(filtered)) > 0.7


def test_without_errors_the_steadied_information_is_the_fisher_information(rng: np.random.Generator) -> None:
    jacobian = rng.normal(size=(3, ROWS))
    same = products(np.tile(jacobian, (REPLICATES, 1, 1)))
    np.testing.assert_allclose(
        steadied_information(same, np.array([1.0, 3.0, 0.1])),
        jacobian @ jacobian.T,
        rtol=1e-9,
        atol=1e-9 * ROWS,
    )
