"""The regression of a score test, against ordinary least squares, and where nothing answers."""

import numpy as np

from cases import THESIS
from emaphm.estimation.posing import problem_of
from emaphm.estimation.problem import Problem
from emaphm.estimation.uncertainty.partial_regression import regressed
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
