"""The regression of a score test, against ordinary least squares, and where nothing answers."""

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


def test_sizes_and_step_are_those_of_least_squares_of_all() -> None:
    rng = np.random.default_rng(1)
    mean, derivatives, residual = rng.normal(size=(4, 400)), rng.normal(size=(2, 400)), rng.normal(size=400)
    step, sizes, covariance = regressed(mean, derivatives, residual, problem())
    together = np.linalg.lstsq(np.vstack([mean, derivatives]).T, residual)[0]
    np.testing.assert_allclose(sizes, together[4:], rtol=1e-6)
    # The step is that of the others for the sizes alone: what the residual asks of them comes on top.
    asked = np.linalg.lstsq(mean.T, residual)[0]
    np.testing.assert_allclose(asked + step, together[:4], rtol=1e-6)
    assert np.all(np.linalg.eigvalsh(covariance) > 0)


def test_an_actuator_that_answers_to_nothing_has_no_score() -> None:
    nothing = np.zeros((4, 400))
    derivative = np.random.default_rng(2).normal(size=(1, 400))
    step, sizes, _ = regressed(nothing, derivative, derivative[0], problem())
    np.testing.assert_array_equal(step, 0.0)
    np.testing.assert_allclose(sizes, 1.0)


def estimate_with(residual: np.ndarray) -> Any:
    """Return what a score test reads of an estimate of four faults that has left a `residual` (400,)."""
    space = SimpleNamespace(prior_deviations=np.full(4, 1e6), dimensions=4, columns=range(4))
    objective = SimpleNamespace(channel_rows=400, space=space, rows_of_priors=np.ones(4), problem=problem())
    return SimpleNamespace(objective=objective, residual=residual, point=np.zeros(4))


def test_what_an_estimate_is_off_does_not_pass_for_one_more_parameter() -> None:
    rng = np.random.default_rng(3)
    fitted, more = rng.normal(size=(4, 400)), rng.normal(size=(1, 400))
    # The recording answers a fifth as much as fitted, and half the further parameter's way.
    answered = 0.2 * fitted + 0.4 * more
    answered[1:] += 0.2 * rng.normal(size=(3, 400))
    draws = rng.normal(0.0, 0.1, (60, 400))
    off = np.linalg.solve(fitted @ answered.T, fitted @ draws.T)
    scores, plain = [], []
    for residual in draws - off.T @ answered:
        sizes, covariance = answered_sizes(estimate_with(residual), (fitted, more), (answered, more))
        scores.append(float(sizes[0] / covariance[0, 0] ** 0.5))
        _, sizes, covariance = regressed(fitted, more, residual, problem())
        plain.append(float(sizes[0] / covariance[0, 0] ** 0.5))
    assert 0.75 < np.std(scores) < 1.25
    assert np.std(plain) > 1.5
    sizes, _ = answered_sizes(estimate_with(draws[0] + 0.3 * more[0]), (fitted, more), (answered, more))
    assert abs(sizes[0] - 0.3) < 0.05
