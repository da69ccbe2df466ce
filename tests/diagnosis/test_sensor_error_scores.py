"""The regression of a score test: against ordinary least squares, and without any response."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from cases import THESIS
from emaphm.estimation.posing import problem_of
from emaphm.estimation.problem import Problem
from emaphm.estimation.uncertainty.partial_regression import answered_sizes, regressed
from emaphm.recording import Recording


def problem() -> Problem:
    rng = np.random.default_rng(0)
    columns = {"time_s": np.arange(400) * 2e-4, "command_rad": rng.normal(size=400) * 1e-3}
    return problem_of(Recording({**columns, "current_A": rng.normal(size=400)}), THESIS)


def test_sizes_and_step_are_those_of_a_joint_least_squares_fit() -> None:
    rng = np.random.default_rng(1)
    mean, derivatives, residual = rng.normal(size=(4, 400)), rng.normal(size=(2, 400)), rng.normal(size=400)
    step, sizes, covariance = regressed(mean, derivatives, residual, problem())
    joint = np.linalg.lstsq(np.vstack([mean, derivatives]).T, residual)[0]
    np.testing.assert_allclose(sizes, joint[4:], rtol=1e-6)
    # The step of the other parameters compensates only the sizes; their own step by the residual is added.
    own_step = np.linalg.lstsq(mean.T, residual)[0]
    np.testing.assert_allclose(own_step + step, joint[:4], rtol=1e-6)
    assert np.all(np.linalg.eigvalsh(covariance) > 0)


def test_without_a_response_the_step_is_0() -> None:
    nothing = np.zeros((4, 400))
    derivative = np.random.default_rng(2).normal(size=(1, 400))
    step, sizes, _ = regressed(nothing, derivative, derivative[0], problem())
    np.testing.assert_array_equal(step, 0.0)
    np.testing.assert_allclose(sizes, 1.0)


def estimate_with(residual: np.ndarray) -> Any:
    """Return the parts of an estimate of four faults with a `residual` (400,) that a score test reads."""
    space = SimpleNamespace(prior_deviations=np.full(4, 1e6), dimensions=4, columns=range(4))
    objective = SimpleNamespace(channel_rows=400, space=space, rows_of_priors=np.ones(4), problem=problem())
    return SimpleNamespace(objective=objective, residual=residual, point=np.zeros(4))


def test_the_error_of_an_estimate_is_not_attributed_to_a_further_parameter() -> None:
    rng = np.random.default_rng(3)
    fitted, further = rng.normal(size=(4, 400)), rng.normal(size=(1, 400))
    # The recording responds a fifth as much as fitted, and partly like the further parameter.
    response = 0.2 * fitted + 0.4 * further
    response[1:] += 0.2 * rng.normal(size=(3, 400))
    draws = rng.normal(0.0, 0.1, (60, 400))
    errors = np.linalg.solve(fitted @ response.T, fitted @ draws.T)
    scores, plain = [], []
    for residual in draws - errors.T @ response:
        sizes, covariance = answered_sizes(estimate_with(residual), (fitted, further), (response, further))
        scores.append(float(sizes[0] / covariance[0, 0] ** 0.5))
        _, sizes, covariance = regressed(fitted, further, residual, problem())
        plain.append(float(sizes[0] / covariance[0, 0] ** 0.5))
    assert 0.75 < np.std(scores) < 1.25
    assert np.std(plain) > 1.5
    sizes, _ = answered_sizes(
        estimate_with(draws[0] + 0.3 * further[0]), (fitted, further), (response, further)
    )
    assert abs(sizes[0] - 0.3) < 0.05
