"""Rests of the shaft: the current there is random, and neither faults nor loads are inferred from it."""

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Chirp
from emaphm.arrays import Array
from emaphm.diagnosis.conclusion import conclude
from emaphm.estimation.discrepancy import reference_problem
from emaphm.estimation.methods import method_named
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.rests import Rests
from emaphm.estimation.search import search
from emaphm.estimation.search_settings import SearchSettings
from emaphm.estimation.standstill import command_stands, with_rests
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

CHANNELS = ("current_A", "voltage_V")
NUISANCES = ("load", "temperature")
HYBRID = method_named("hybrid")


def moving_smoothly(time_s: Array) -> Array:
    """Return four moves of minimum jerk over 250 ms each, 50 ms apart."""
    levels, moved = np.array([0.0, 4e-3, -3e-3, 4.5e-3, 0.0]), np.zeros_like(np.asarray(time_s, float))
    for k, change in enumerate(np.diff(levels)):
        share = np.clip((np.asarray(time_s) - 0.02 - 0.3 * k) / 0.25, 0.0, 1.0)
        moved += change * share**3 * (10 - 15 * share + 6 * share**2)
    return moved


def stepping(time_s: Array) -> Array:
    """Return steps to either side, after each of which the shaft rests for most of 150 ms."""
    levels = np.array([0.0, 3e-3, -3e-3, 1.5e-3])
    return np.asarray(levels[np.minimum(np.asarray(time_s) // 0.15, 3).astype(int)])


def recorded(load: float, seed: int) -> Recording:
    whole = simulate(
        THESIS,
        stepping,
        duration=0.6,
        sample_rate=2500.0,
        load=load,
        noise=0.05,
        adc_bits=12,
        seed=seed,
    )
    return Recording({name: whole[name] for name in ("time_s", "command_rad", *CHANNELS)})


def test_the_removed_offset_of_a_rest_is_its_most_probable_value() -> None:
    rng = np.random.default_rng(3)
    bounds, noise = np.array([[2, 9], [12, 20]]), np.array([0.3, 0.05])
    patterns = rng.normal(0.0, 0.2, (2, 2))
    measured = rng.normal(0.0, 1.0, (2, 20))
    outputs = rng.normal(0.0, 1.0, (3, 2, 20))
    drawn = outputs.copy()
    Rests.of(bounds, patterns, noise).draw(drawn, measured)
    for k, (first, after) in enumerate(bounds):
        # Least squares with one more row for the prior of the offset, 0 ± 1.
        column = np.repeat(patterns[k] / noise, after - first)
        for before, after_draw in zip(outputs, drawn, strict=True):
            rows = ((measured - before)[:, first:after] / noise[:, np.newaxis]).ravel()
            (offset,) = np.linalg.lstsq(np.append(column, 1.0)[:, np.newaxis], np.append(rows, 0.0))[0]
            moved = (after_draw - before)[:, first:after]
            np.testing.assert_allclose(moved, np.outer(offset * patterns[k], np.ones(after - first)))
    outside = np.r_[0:2, 9:12]
    np.testing.assert_array_equal(drawn[:, :, outside], outputs[:, :, outside])


def test_rows_that_are_not_compared_do_not_change_the_removed_offset() -> None:
    rng = np.random.default_rng(5)
    bounds, noise = np.array([[2, 14]]), np.array([0.3, 0.05])
    patterns, outputs = rng.normal(0.0, 0.2, (1, 2)), rng.normal(0.0, 1.0, (3, 2, 20))
    measured = rng.normal(0.0, 1.0, (2, 20))
    rows = np.r_[2:6, 10:14]
    (shorter, fewer), kept = (measured[:, rows], outputs[:, :, rows]), outputs[:, :, rows].copy()
    Rests.of(np.array([[0, 8]]), patterns, noise).draw(fewer, shorter)
    outputs[:, :, 6:10] = measured[:, 6:10]
    drawn = outputs.copy()
    Rests.of(bounds, patterns, noise, np.array([[8, 8]])).draw(drawn, measured)
    np.testing.assert_allclose(drawn[:, :, rows] - kept, fewer - kept)


def test_the_residual_of_a_dropout_within_a_rest_is_0() -> None:
    recording = recorded(0.0, 1)
    dropout = {"current_A": (recording["time_s"] > 0.22) & (recording["time_s"] < 0.25)}
    objective = faults_objective(problem_of(recording, THESIS, channels=CHANNELS), NUISANCES)
    objective, point = objective.ignoring(dropout), np.zeros(objective.space.dimensions)
    rng = np.random.default_rng(2)
    resting = with_rests(objective, point, reference_problem(objective), rng)
    assert resting.problem.rests is not None
    residual = resting.residual(point)[: recording.samples]
    assert np.all(residual[dropout["current_A"]] == 0)
    assert np.any(resting.problem.rests.patterns != 0)


def test_steps_have_rests_and_a_chirp_has_none() -> None:
    chirp = problem_of(simulate(THESIS, Chirp()), THESIS)
    assert not command_stands(chirp)
    objective = faults_objective(chirp, NUISANCES)
    point = np.zeros(objective.space.dimensions)
    rng = np.random.default_rng(0)
    assert with_rests(objective, point, reference_problem(objective), rng) is objective
    assert command_stands(problem_of(recorded(0.0, 0), THESIS))


def test_a_constant_command_from_the_beginning_is_no_rest() -> None:
    """All runs begin in the same state: the current there is not random."""
    recording = simulate(THESIS, lambda t: 1e-3 * np.maximum(np.asarray(t) - 0.1, 0.0), duration=0.2)
    assert not command_stands(problem_of(recording, THESIS))


@pytest.mark.parametrize("count", [1, pytest.param(6, marks=pytest.mark.evidence)])
def test_the_scatter_of_a_load_agrees_with_its_error_where_the_shaft_rests(count: int) -> None:
    scores = []
    for seed in range(count):
        load = 0.02 + 0.002 * seed
        recording = recorded(load, seed)
        problem = problem_of(recording, THESIS, channels=CHANNELS)
        objective = faults_objective(problem, NUISANCES)
        result = search(objective, SearchSettings(HYBRID, 10, 0), fitness="least_squares")
        diagnosis = conclude(result, recording, "hybrid", "least_squares", 0)
        assert diagnosis.explained
        estimate = diagnosis.nuisances["load"]
        scores.append((estimate.value - load) / estimate.standard_error)
    # With all rows of the rests, the rms deviation of the load was 3.9 standard errors.
    assert np.sqrt(np.mean(np.square(scores))) < 2


@pytest.mark.evidence
def test_the_scatter_of_a_gain_agrees_with_its_error_in_slow_motion() -> None:
    scores = []
    for seed in range(20, 26):
        whole = simulate(
            THESIS, moving_smoothly, duration=1.25, load=0.08, noise=0.05, adc_bits=12, seed=seed
        )
        recording = Recording({name: whole[name] for name in ("time_s", "command_rad", *CHANNELS)})
        objective = faults_objective(problem_of(recording, THESIS, channels=CHANNELS), NUISANCES)
        result = search(objective, SearchSettings(HYBRID, 10, seed), fitness="least_squares")
        gain = conclude(result, recording, "hybrid", "least_squares", seed, tests=False).components["gain"]
        scores.append((gain.value - 0.5) / gain.standard_error)
    # With the ripple and the derivatives of the averaged model, the rms deviation was 4.2 standard errors.
    assert np.sqrt(np.mean(np.square(scores))) < 2
