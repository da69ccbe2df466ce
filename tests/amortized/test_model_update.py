"""The update by the averaged model, against least squares whose answer is known."""

from dataclasses import replace

import numpy as np
import pytest

from amortized.toys import CHIRP, short_setup
from emaphm.amortized import model_update
from emaphm.amortized.model_update import UpdateStep, Whitening
from emaphm.amortized.networks.mixture import Mixture
from emaphm.amortized.recording_setup import RecordingSetup
from emaphm.amortized.simulating import TrainingSet, noise_rms
from emaphm.arrays import Array, Single
from emaphm.simulation import AVERAGED, Inputs, Model

SETUP = short_setup(nuisances=(), channels=("current_A",))
D = SETUP.space.dimensions
ROWS = 12
MIDDLE = np.full(D, 0.4)
RESPONSE = np.random.default_rng(0).normal(size=(D, ROWS))


@pytest.fixture
def linear(monkeypatch: pytest.MonkeyPatch) -> Inputs:
    """Put a linear model in place of the averaged one."""

    def rows(_setup: RecordingSetup, _inputs: Inputs, _model: Model, points: Array) -> Single:
        return (points @ RESPONSE)[:, np.newaxis].astype(np.float32)

    def others(_setup: RecordingSetup, _inputs: Inputs, points: Array) -> Single:
        found = np.stack([points @ RESPONSE[::-1], points @ RESPONSE[::-1] ** 2], axis=1)
        return found[:, :, np.newaxis].astype(np.float32)

    monkeypatch.setattr(model_update, "simulated", rows)
    monkeypatch.setattr(model_update, "other_descriptions", others)
    monkeypatch.setattr(model_update, "UPDATE", replace(model_update.UPDATE, floor=0.0))
    return SETUP.inputs(CHIRP, AVERAGED.step_for(SETUP.actuator))


def answers_about(means: Array, rng: np.random.Generator) -> list[Mixture]:
    factor = 0.05 * (np.eye(D) + 0.2 * np.tril(rng.normal(size=(D, D)), -1))
    return [Mixture(np.ones(1), mean[np.newaxis], factor[np.newaxis]) for mean in means]


def draws(count: int, rng: np.random.Generator, scatter: Array) -> tuple[Array, Single, Single]:
    """Return points, and rows of a reference model that differs from the linear one by `scatter`."""
    points = MIDDLE + 0.05 * rng.normal(size=(count, D))
    exact = points @ RESPONSE + 0.3 + rng.normal(size=(count, ROWS)) @ scatter.T
    noise = noise_rms(SETUP)[0] * rng.normal(size=exact.shape)
    as_rows = [values[:, np.newaxis].astype(np.float32) for values in (exact, exact + noise)]
    return points, as_rows[0], as_rows[1]


def test_a_step_is_the_posterior_of_a_linear_model(linear: Inputs) -> None:
    rng = np.random.default_rng(1)
    scatter = 0.1 * rng.normal(size=(ROWS, ROWS))
    points, exact, rows = draws(6000, rng, scatter)
    answers = answers_about(np.tile(MIDDLE, (6000, 1)), rng)
    learned = TrainingSet(points.astype(np.float32), exact)
    whitening = Whitening.of(SETUP, linear, learned, rows, answers, np.array([0.05]))
    step = UpdateStep.of(SETUP, linear, whitening, rows[:200], answers[:200])
    prior = answers[0].covariance
    noise = scatter @ scatter.T + noise_rms(SETUP)[0] ** 2 * np.eye(ROWS)
    expected = np.linalg.inv(np.linalg.inv(prior) + RESPONSE @ np.linalg.solve(noise, RESPONSE.T))
    residual = rows[:200, 0] - MIDDLE @ RESPONSE - 0.3
    means = MIDDLE + residual @ np.linalg.solve(noise, RESPONSE.T) @ expected
    deviations = np.sqrt(np.diag(expected))
    # 6,000 draws know each of the 12 variances to 2 %.
    assert np.sqrt(np.mean((step.means - means) ** 2, axis=0) / deviations**2).max() < 0.15
    stated = step.factors[0] @ step.factors[0].T
    np.testing.assert_allclose(np.sqrt(np.diag(stated)), deviations, rtol=0.05)
    missed = step.units_of(points[:200])
    assert abs(float(np.mean(missed**2)) - 1) < 0.15
    np.testing.assert_allclose(step.points_of(missed), points[:200], atol=1e-12)


def test_at_a_bound_the_runs_lie_within(linear: Inputs) -> None:
    rng = np.random.default_rng(2)
    corner = SETUP.space.project(np.full(D, 2.0))
    answers = answers_about(corner[np.newaxis], rng)
    runs = model_update._Runs.about(SETUP, linear, answers)
    away = np.einsum("rj,ij->ri", runs.moves[0], runs.factors[0])
    points = corner + away
    np.testing.assert_allclose(SETUP.space.project(points), points, atol=1e-9)
    assert np.all(np.linalg.norm(away, axis=1) > 0.01)
    whitening = Whitening(np.ones(1), np.zeros(ROWS, np.float32), np.eye(ROWS, dtype=np.float32))
    step = UpdateStep.of(SETUP, linear, whitening, np.zeros((1, 1, ROWS), np.float32), answers)
    assert np.all(np.isfinite(step.features))
