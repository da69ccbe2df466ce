"""Other libraries as oracles: surpyval's Wiener process, progpy's metrics after conversion.

They are loaded by the tests, since they take seconds.
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
    # Their own warnings while they are imported, and their style of figures, are not ours.
    with warnings.catch_warnings(), mpl.rc_context():
        warnings.simplefilter("ignore")
        return pytest.importorskip(name)


def remaining_lives(pace: float = 1.0) -> np.ndarray:
    """Return when a Wiener process passes its limit [h], by the forecast of a unit in a known state."""
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
    made = paths(state, Prior(WIENER), seed=5, pace=pace, settings=settings)
    passed = first_passage(
        made.hours, LIMIT - made.level[:, :, 0], made.noise[:, :, 0], np.random.default_rng(6)
    )
    return np.minimum(passed, REACH)


def test_a_wiener_process_lasts_as_surpyval_says() -> None:
    degradation = loaded("surpyval.degradation")
    model = degradation.WienerProcessModel(mu=RATE, sigma=NOISE / SCALE**0.5, threshold=LIMIT)
    found = remaining_lives()
    assert kstest(found, lambda t: model.ff(t, y0=START)).pvalue > 0.01
    theirs = model.predict_rul(START, alpha_ci=0.1)
    ours = np.quantile(found, [0.5, 0.05, 0.95])
    # Five standard errors of a quantile of 4,000 values, from the distribution's own density.
    for quantile, value, share in zip(
        ours, (theirs.rul, *theirs.rul_interval), (0.5, 0.05, 0.95), strict=True
    ):
        error = np.sqrt(share * (1 - share) / PATHS) / model.df(value, y0=START)
        assert quantile == pytest.approx(value, abs=5 * float(error))


def test_a_stressed_wiener_process_lasts_as_surpyval_says() -> None:
    """Both let the clock run exp(β·z) times as fast, drift and variance alike: here a load's power."""
    degradation = loaded("surpyval.degradation")
    reference, stress, exponent = StressReference(load=2.0), Stress(load=5.0), 1.3
    z = reference.covariates(stress)
    model = degradation.WienerProcessModel(
        mu=RATE, sigma=NOISE / SCALE**0.5, threshold=LIMIT, gamma=[exponent], stress_ref=[0.0]
    )
    found = remaining_lives(pace=float(np.exp(exponent * z[0])))
    assert kstest(found, lambda t: model.ff(t, Z=[z[0]], y0=START)).pvalue > 0.01


def profile(predictions: list[Prediction]) -> Any:
    """Return predictions of the RUL as progpy's of the time of the event."""
    predictors, uncertain = loaded("progpy.predictors"), loaded("progpy.uncertain_data")
    made = predictors.ToEPredictionProfile()
    for one in predictions:
        made.add_prediction(
            one.hours, uncertain.UnweightedSamples([{"fails": one.hours + float(x)} for x in one.sample])
        )
    return made


def predictions_of(failure: float) -> list[Prediction]:
    random = np.random.default_rng(11)
    return [
        Prediction(
            t,
            np.abs(
                failure - t + 0.15 * failure * random.standard_normal() + 60 * random.standard_normal(400)
            ),
        )
        for t in np.arange(50.0, failure, 50.0)
    ]


def test_alpha_lambda_is_progpys_at_the_time_of_a_prediction() -> None:
    """λ is a share of life here and an hour there; both look at α of the true RUL."""
    failure = 1000.0
    predictions = predictions_of(failure)
    theirs = profile(predictions)
    answers = []
    for one in predictions:
        share = (one.hours - predictions[0].hours) / (failure - predictions[0].hours)
        for beta in (0.2, 0.5):
            ours = alpha_lambda(predictions, failure, share, alpha=0.2, beta=beta)
            assert ours is bool(theirs.alpha_lambda({"fails": failure}, one.hours, 0.2, beta)["fails"])
            answers.append(ours)
    assert 0.1 < np.mean(answers) < 0.9


def test_the_first_horizon_is_progpys_and_a_lost_one_is_not_revoked_there() -> None:
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


def test_relative_accuracy_converts_to_progpys() -> None:
    """Theirs is on the time of the event, and of the mean; ours on the RUL, and of the median."""
    failure = 1000.0
    for one in predictions_of(failure):
        symmetric = Prediction(one.hours, np.concatenate([one.sample, 2 * one.median - one.sample]).clip(0))
        mean = float(np.mean(symmetric.sample))
        ours = relative_accuracy(Prediction(one.hours, np.array([mean])), failure)
        true = failure - one.hours
        theirs = profile([symmetric]).cumulative_relative_accuracy({"fails": failure})["fails"]
        assert 1 - true / failure * (1 - ours) == pytest.approx(theirs)
