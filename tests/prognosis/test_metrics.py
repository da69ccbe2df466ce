"""Metrics of predictions against their definitions: hand calculations, integrals, simulated truths."""

import math

import numpy as np
import pytest
from scipy.stats import norm

from emaphm.errors import PrognosisError
from emaphm.prognosis.metrics import (
    Prediction,
    alpha_lambda,
    at_share_of_life,
    brier,
    coverage,
    crps,
    cumulative_relative_accuracy,
    false_alarms_per_1000_hours,
    late_prediction_rate,
    probability_integral_transform,
    prognostic_horizon,
    relative_accuracy,
    wasted_life,
)


def certain(hours: float, rul: float) -> Prediction:
    return Prediction(hours, np.full(10, rul))


def test_the_crps_equals_the_integral_that_defines_it() -> None:
    sample = np.random.default_rng(0).gamma(2.0, 50.0, 200)
    grid = np.linspace(0, 2000, 400_001)
    distribution = np.searchsorted(np.sort(sample), grid, "right") / sample.size
    for true in (5.0, 90.0, 700.0):
        integral = np.trapezoid((distribution - (grid >= true)) ** 2, grid)
        assert crps(sample, true) == pytest.approx(integral, abs=0.01)  # two steps of the grid


def test_the_crps_of_a_normal_prediction_agrees_with_its_closed_form() -> None:
    """Gneiting and Raftery (2007), eq. 21, for a normal distribution: σ (z (2 Φ - 1) + 2 φ - 1 / √π)."""
    n = 20_000
    sample = 300 + 40 * norm.ppf((np.arange(n) + 0.5) / n)
    for true in (250.0, 300.0, 380.0):
        z = (true - 300) / 40
        exact = 40 * (z * (2 * norm.cdf(z) - 1) + 2 * norm.pdf(z) - 1 / math.sqrt(math.pi))
        assert crps(sample, true) == pytest.approx(exact, rel=1e-3)


def test_a_prediction_without_failure_has_a_finite_crps_only_up_to_a_longest_time() -> None:
    assert crps([10.0, math.inf], 10.0) == math.inf
    # F is 1/2 instead of 1 from 10 to 100 h: the integral of (1/2)² is 90 / 4.
    assert crps([10.0, math.inf], 10.0, longest=100.0) == pytest.approx(22.5)
    assert crps([math.inf], math.inf, longest=100.0) == 0


def test_transforms_of_calibrated_predictions_are_uniform() -> None:
    random = np.random.default_rng(1)
    transforms = []
    for _ in range(2000):
        centre = random.normal(500, 100)
        transforms.append(
            probability_integral_transform(
                Prediction(0.0, np.maximum(random.normal(centre, 30, 200), 0)), random.normal(centre, 30)
            )
        )
    assert coverage(transforms) == pytest.approx(0.9, abs=3 * math.sqrt(0.09 / 2000))
    shares, _ = np.histogram(transforms, 10, (0, 1))
    assert np.all(np.abs(shares - 200) < 4 * math.sqrt(180))


def test_ties_count_half_in_the_probability_integral_transform() -> None:
    assert probability_integral_transform(certain(0, 5), 5) == 0.5
    assert probability_integral_transform(certain(0, 5), 4) == 0
    assert probability_integral_transform(Prediction(0, np.array([1.0, math.inf])), 3) == 0.5


def test_a_lasting_horizon_begins_after_the_last_prediction_outside_the_band() -> None:
    # Failure at 100 h, band of ±20 h: good at 20, lost at 40, good from 60 on.
    predictions = [certain(0, 300), certain(20, 85), certain(40, 200), certain(60, 45), certain(80, 10)]
    horizon = prognostic_horizon(predictions, 100.0)
    assert (horizon.first, horizon.lasting) == (80.0, 40.0)
    late = prognostic_horizon([certain(0, 300), certain(120, 0)], 100.0)
    assert (late.first, late.lasting) == (0, 0)
    after = prognostic_horizon([*predictions, certain(110, 50)], 100.0)
    assert after == horizon
    never = prognostic_horizon([certain(0, 300)], 100.0)
    assert (never.first, never.lasting) == (0.0, 0.0)


def test_the_alpha_lambda_band_narrows_with_the_remaining_life() -> None:
    predictions = [certain(0, 115), certain(50, 59), certain(75, 31)]
    assert alpha_lambda(predictions, 100.0, 0.0)
    assert alpha_lambda(predictions, 100.0, 0.5)
    assert alpha_lambda(predictions, 100.0, 0.7)  # the prediction at 50 h
    assert not alpha_lambda(predictions, 100.0, 0.75)
    assert at_share_of_life([0.0, 50.0, 75.0], 100.0, 0.74) == 1
    half = Prediction(0.0, np.array([100.0, 101, 300, 400]))
    assert alpha_lambda([half], 100.0, 0.0, beta=0.5)
    assert not alpha_lambda([half], 100.0, 0.0, beta=0.51)


def test_the_prediction_at_a_share_of_life_is_found_despite_rounding() -> None:
    """In floating-point numbers, 0.29 × 100 h is less than 29 h."""
    hours = list(range(100))
    assert [at_share_of_life(hours, 100.0, i / 100) for i in range(100)] == hours


def test_relative_accuracy_refers_to_the_remaining_life() -> None:
    """After conversion it equals the accuracy that `progpy` computes for the time of the event."""
    prediction, failure = certain(80, 30), 100.0
    assert relative_accuracy(prediction, failure) == pytest.approx(0.5)
    of_the_event = 1 - abs(110 - 100) / 100
    assert 1 - (20 / failure) * (1 - relative_accuracy(prediction, failure)) == pytest.approx(of_the_event)
    assert cumulative_relative_accuracy(
        [certain(0, 90), prediction, certain(120, 1)], failure
    ) == pytest.approx(0.7)
    assert relative_accuracy(certain(80, math.inf), failure) == -math.inf


def test_brier_score_late_predictions_wasted_life_and_false_alarms_by_hand() -> None:
    assert brier([1.0, 0.0, 0.5], [True, False, True]) == pytest.approx(0.25 / 3)
    assert late_prediction_rate([(certain(0, 11), 10.0), (certain(0, 9), 10.0)]) == 0.5
    assert late_prediction_rate([(certain(0, 11), 10.0), (certain(0, 13), 10.0)], margin=0.2) == 0.5
    assert wasted_life([75.0, 120.0], [100.0, 100.0]) == pytest.approx(0.125)
    assert false_alarms_per_1000_hours([(10, 500.0), (20, 30.0), (5, math.inf)], 4000.0, 100.0) == 0.5


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: Prediction(0.0, np.array([])),
        lambda: Prediction(0.0, np.array([-1.0])),
        lambda: Prediction(0.0, np.array([1.0, math.nan])),
        lambda: relative_accuracy(certain(100, 1), 100.0),
        lambda: at_share_of_life([100.0], 50.0, 0.5),
        lambda: at_share_of_life([0.0], 50.0, 1.5),
        lambda: brier([1.2], [True]),
        lambda: brier([], []),
        lambda: wasted_life([1.0], [0.0]),
        lambda: false_alarms_per_1000_hours([], 0.0, 1.0),
        lambda: late_prediction_rate([]),
        lambda: cumulative_relative_accuracy([], 5.0),
    ],
)
def test_invalid_predictions_and_arguments_are_refused(wrong: object) -> None:
    with pytest.raises(PrognosisError):
        wrong()  # type: ignore[operator]
