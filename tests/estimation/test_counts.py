"""Quantisation of slow quantities: the model reproduces counts of a converter; they are not noise."""

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Faults, Sine
from emaphm.arrays import Array
from emaphm.estimation.bias_correction import with_discrepancy
from emaphm.estimation.objective import MapObjective, faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.sensors.counts import errors_of_counts, errors_of_rests, in_counts, visible_count
from emaphm.estimation.uncertainty.local_covariance import rounding_scores
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

COUNT = 0.3
SLOW = 4 * np.sin(np.linspace(0.0, 9.0, 900))
FAULTS = Faults(friction=0.3, backlash=0.2)


def quantised(signal: Array, noise: float = 0.0) -> Array:
    noisy = signal + np.random.default_rng(0).normal(0.0, noise, signal.size)
    return np.asarray(COUNT * np.round(noisy / COUNT))


@pytest.mark.parametrize("offset", [0.0, 0.1])
def test_the_count_of_a_slow_signal_is_detected(offset: float) -> None:
    recorded = quantised(SLOW) + offset
    assert visible_count(recorded) == pytest.approx(COUNT)
    assert visible_count(np.round(recorded, 3)) == pytest.approx(COUNT, rel=1e-2)
    np.testing.assert_allclose(in_counts(SLOW + offset, recorded, COUNT), recorded, atol=1e-12)


@pytest.mark.parametrize(
    "values",
    [
        SLOW,
        quantised(SLOW, noise=COUNT),
        quantised(50 * SLOW[::10]),
        np.repeat(quantised(SLOW[::5], noise=10 * COUNT), 5),
        np.repeat(SLOW[::5], 5),
        np.full(900, 0.3),
    ],
    ids=["exact", "dithered", "fast", "noisy and held", "held", "constant"],
)
def test_no_count_is_detected_in_noise_or_in_continuous_values(values: Array) -> None:
    assert visible_count(values) == 0.0


@pytest.fixture(scope="module")
def coarse() -> MapObjective:
    whole = simulate(THESIS, Sine(), faults=FAULTS, duration=0.25, adc_bits=10)
    names = ("time_s", "command_rad", "current_A", "position_rad")
    problem = problem_of(Recording({name: whole[name] for name in names}), THESIS, channels=None)
    return faults_objective(problem, ("load",))


def test_at_the_truth_counts_leave_no_residual(coarse: MapObjective) -> None:
    assert tuple(coarse.problem.counts) == ("position_rad",)
    count = coarse.problem.counts["position_rad"]
    vector = FAULTS.vector
    point = np.zeros(coarse.space.dimensions)
    for i, name in enumerate(coarse.space.coordinates):
        point[i] = getattr(FAULTS, name) if name in ("friction", "backlash") else point[i]
    point[coarse.space.coordinates.index("gain")] = FAULTS.gain
    np.testing.assert_allclose(coarse.space.faults(point)[:6], vector[:6])
    residual = with_discrepancy(SearchResult.at(coarse, point), seed=0).residual_by_channel["position_rad"]
    assert np.sqrt(np.mean(residual**2)) < 0.1 * count / 12**0.5


def test_rows_of_a_count_share_its_error_unless_it_is_passed() -> None:
    # The signal rests at the first count, passes the second, reverses at the third and ends at the last.
    values, sensitive = np.array([0.0, 0, 0, 1, 1, 2, 2, 1, 1]), np.ones((1, 9))
    scores = errors_of_counts(values, 2.0).scores(sensitive)
    assert scores * 12 / 2.0**2 == pytest.approx(3**2 + 1 + 1 + 2**2 + 2**2)


@pytest.mark.parametrize("noise", [0.0, 0.05, 0.125, 0.25, 0.4])
def test_the_stated_error_of_the_mean_of_a_rest_covers_its_deviation(noise: float) -> None:
    rng = np.random.default_rng(2)
    fast = np.concatenate([np.arange(0, 600, 3), np.arange(599, -1, -4)])
    ratios = []
    for level in rng.uniform(-2.0, 2.0, 200):
        recorded = COUNT * np.concatenate([fast, np.round(level + rng.normal(0.0, noise, 400))])
        assert visible_count(recorded) == 0.0
        rests = errors_of_rests(recorded)
        for first, length, error in zip(rests.first, rests.lengths, rests.errors, strict=True):
            rows = slice(max(first, fast.size), first + length)
            white = COUNT * np.hypot(noise, 12**-0.5) / length**0.5
            ratios.append((recorded[rows].mean() - COUNT * level) / np.hypot(error, white))
    assert len(ratios) >= 50
    assert np.mean(np.abs(ratios) < 1.96) >= 0.95


def test_the_rounding_error_of_counts_is_part_of_the_score_covariance(coarse: MapObjective) -> None:
    jacobian = np.random.default_rng(1).normal(size=(3, coarse.channel_rows))
    problem = coarse.problem
    assert tuple(problem.channels) == ("current_A", "position_rad")
    current, position = (problem.measured[name] for name in problem.channels)
    of_current, of_position = np.split(jacobian, 2, axis=1)
    expected = problem.weights[0] ** 2 * errors_of_rests(current).scores(of_current)
    counts = errors_of_counts(position, problem.counts["position_rad"])
    expected += problem.weights[1] ** 2 * counts.scores(of_position)
    np.testing.assert_allclose(rounding_scores(coarse.problem, jacobian), expected)


def test_the_rounding_error_of_its_counts_limits_the_weight_of_a_channel(coarse: MapObjective) -> None:
    residual = np.full(coarse.target.size, 1e-9)
    residual[: coarse.problem.samples] = 0.1
    weights = coarse.reweighted(residual).problem.weights
    assert weights[1] == pytest.approx(0.1 / (coarse.problem.counts["position_rad"] / 12**0.5))


def test_the_rounding_error_of_counts_is_a_lower_limit_of_the_mean_square(coarse: MapObjective) -> None:
    size = coarse.problem.weights[1] * coarse.problem.counts["position_rad"] / 12**0.5
    assert coarse.mean_square(np.zeros(coarse.channel_rows)) == pytest.approx(size**2 / 2)
