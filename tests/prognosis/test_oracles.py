"""Forecasts against surpyval's Wiener process, and metrics against progpy's after conversion.

The tests import these libraries themselves, because an import takes seconds.
"""

import warnings
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from scipy.stats import kstest

from emaphm.prognosis import StressReference
from emaphm.prognosis.forecast import UnitDraws, paths
from emaphm.prognosis.metrics import (
    Prediction,
    alpha_lambda,
    prognostic_horizon,
    relative_accuracy,
)
from emaphm.prognosis.prior import NEW, Prior
from emaphm.prognosis.requirements.first_passage import first_passage
from emaphm.prognosis.settings import CONSTANT, LINEAR, DegradationSettings, ForecastSettings
from emaphm.prognosis.stress import Stress

SCALE, NOISE, RATE, START, LIMIT, REACH = 1000.0, 0.3, 5e-4, 0.4, 0.8, 40_000.0
WIENER = DegradationSettings(noise=NOISE, rate_noise=0.0, change_hours=1e12, breaks=0.0)
PATHS = 4000


def loaded(name: str) -> Any:
    # An import may give warnings and change the style of figures; neither may affect other tests.
    with warnings.catch_warnings(), mpl.rc_context():
        warnings.simplefilter("ignore")
        return pytest.importorskip(name)


def remaining_lives(pace: float = 1.0) -> np.ndarray:
    """Return first passages [h] of a Wiener process, from the forecast of a unit in a known state."""
    shape = (PATHS, 8)
    law, level, rate = np.full(shape, CONSTANT, np.int8), np.tile(NEW, (PATHS, 1)), np.zeros(shape)
    law[:, 0], level[:, 0], rate[:, 0] = LINEAR, START, RATE
    state = UnitDraws(
        aged=np.zeros(shape),
        exponents=np.zeros((*shape, 3)),
        law=law,
        life_scale=np.full(shape, SCALE),
        shape=np.full(shape, 0.5),
        roughness=np.ones(shape),
        unevenness=np.zeros(shape),
        level=level,
        rate=rate,
    )
    settings = ForecastSettings(longest_hours=REACH, steps=40)
    forecast = paths(state, Prior(WIENER), seed=5, pace=pace, settings=settings)
    passed = first_passage(
        forecast.hours, LIMIT - forecast.level[:, :, 0], forecast.noise[:, :, 0], np.random.default_rng(6)
    )
    return np.minimum(passed, REACH)


def test_the_rul_of_a_wiener_process_agrees_with_surpyval() -> None:
    degradation = loaded("surpyval.degradation")
    model = degradation.WienerProcessModel(mu=RATE, sigma=NOISE / SCALE**0.5, threshold=LIMIT)
    hours = remaining_lives()
    assert kstest(hours, lambda t: model.ff(t, y0=START)).pvalue > 0.01
    theirs = model.predict_rul(START, alpha_ci=0.1)
    ours = np.quantile(hours, [0.5, 0.05, 0.95])
    # Five standard errors of a quantile of 4,000 values, from the density of the distribution.
    for quantile, value, share in zip(
        ours, (theirs.rul, *theirs.rul_interval), (0.5, 0.05, 0.95), strict=True
    ):
        error = np.sqrt(share * (1 - share) / PATHS) / model.df(value, y0=START)
        assert quantile == pytest.approx(value, abs=5 * float(error))


def test_the_rul_of_a_stressed_wiener_process_agrees_with_surpyval() -> None:
    """Both models scale time by exp(β·z), for drift and variance alike; here z is of a load's power law."""
    degradation = loaded("surpyval.degradation")
    reference, stress, exponent = StressReference(load=2.0), Stress(load=5.0), 1.3
    z = reference.covariates(stress)
    model = degradation.WienerProcessModel(
        mu=RATE, sigma=NOISE / SCALE**0.5, threshold=LIMIT, gamma=[exponent], stress_ref=[0.0]
    )
    hours = remaining_lives(pace=float(np.exp(exponent * z[0])))
    assert kstest(hours, lambda t: model.ff(t, Z=[z[0]], y0=START)).pvalue > 0.01


def profile(predictions: list[Prediction]) -> Any:
    """Return RUL predictions in progpy's form, as predictions of the time of the event."""
    predictors, uncertain = loaded("progpy.predictors"), loaded("progpy.uncertain_data")
    converted = predictors.ToEPredictionProfile()
    for prediction in predictions:
        converted.add_prediction(
            prediction.hours,
            uncertain.UnweightedSamples([{"fails": prediction.hours + float(x)} for x in prediction.sample]),
        )
    return converted


def predictions_of(failure: float) -> list[Prediction]:
    random = np.random.default_rng(11)
    return [
        Prediction(
            hours,
            np.abs(
                failure - hours + 0.15 * failure * random.standard_normal() + 60 * random.standard_normal(400)
            ),
        )
        for hours in np.arange(50.0, failure, 50.0)
    ]


def test_alpha_lambda_agrees_with_progpy_at_the_time_of_a_prediction() -> None:
    """λ is a share of life here and an hour in progpy; α is relative to the true RUL in both."""
    failure = 1000.0
    predictions = predictions_of(failure)
    theirs = profile(predictions)
    answers = []
    for prediction in predictions:
        share = (prediction.hours - predictions[0].hours) / (failure - predictions[0].hours)
        for beta in (0.2, 0.5):
            ours = alpha_lambda(predictions, failure, share, alpha=0.2, beta=beta)
            assert ours is bool(theirs.alpha_lambda({"fails": failure}, prediction.hours, 0.2, beta)["fails"])
            answers.append(ours)
    assert 0.1 < np.mean(answers) < 0.9


def test_the_first_horizon_agrees_with_progpy_whose_horizon_need_not_last() -> None:
    failure, alpha, beta = 1000.0, 0.2, 0.5

    def good(tte: Any, truth: dict[str, float]) -> dict[str, bool]:
        low, high = truth["fails"] - alpha * failure, truth["fails"] + alpha * failure
        return {"fails": tte.percentage_in_bounds({"fails": [low, high]})["fails"] >= beta}

    predictions = predictions_of(failure)
    predictions[4] = Prediction(predictions[4].hours, np.full(50, 5.0 * failure))
    ours = prognostic_horizon(predictions, failure, alpha=alpha, beta=beta)
    theirs = profile(predictions).prognostic_horizon(good, {"fails": failure})["fails"]
    assert ours.first == pytest.approx(theirs)
    assert ours.lasting < theirs


def test_converted_relative_accuracy_agrees_with_progpy() -> None:
    """The accuracy of progpy is of the mean time of the event, that of emaphm of the median RUL."""
    failure = 1000.0
    for prediction in predictions_of(failure):
        symmetric = Prediction(
            prediction.hours,
            np.concatenate([prediction.sample, 2 * prediction.median - prediction.sample]).clip(0),
        )
        mean = float(np.mean(symmetric.sample))
        ours = relative_accuracy(Prediction(prediction.hours, np.array([mean])), failure)
        true = failure - prediction.hours
        theirs = profile([symmetric]).cumulative_relative_accuracy({"fails": failure})["fails"]
        assert 1 - true / failure * (1 - ours) == pytest.approx(theirs)
