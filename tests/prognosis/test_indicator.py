"""Prognoses of a user's health indicator against the closed form of a Wiener process; invalid input."""

import json
import math

import numpy as np
import pytest
from scipy.stats import invgauss, kstest, norm

from emaphm.errors import PrognosisError
from emaphm.prognosis import Question
from emaphm.prognosis.indicator import Indicator, Reading, prognose_indicator
from emaphm.prognosis.notes.receding import receding_notes
from emaphm.prognosis.prior import Prior
from emaphm.prognosis.settings import DegradationSettings, FilterSettings, ForecastSettings

FEWER = FilterSettings(particles=4000)
"""Enough particles for an indicator with a course that is probable under the prior."""


def readings(rate: float, *, start: float = 2.0, count: int = 30, error: float = 0.05) -> tuple[Reading, ...]:
    random = np.random.default_rng(3)
    return tuple(
        Reading(40.0 * i, start + rate * 40.0 * i + error * random.standard_normal(), error**2)
        for i in range(count)
    )


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_rising_or_falling_indicator_is_extrapolated_to_its_limit(sign: float) -> None:
    """A slope of 2 mA per hour leads to 4.32 A at 1,160 h, 840 h before the 6 A limit; or mirrored."""
    indicator = Indicator("A", 2.0, 2.0 + 4 * sign, readings(2e-3 * sign), 1160.0, "current [A]")
    prognosis = prognose_indicator(indicator, filter_settings=FEWER)
    low, high = prognosis.interval90
    assert prognosis.median == pytest.approx(840.0, rel=0.15)
    assert low < 840 < high
    assert prognosis.value90[1] == pytest.approx(2.0 + sign * 2.32, abs=0.06)
    assert prognosis.laws["constant"] < 0.01
    document = json.loads(json.dumps(prognosis.to_dict(), allow_nan=False))
    assert document["rul_hours"]["median"] == prognosis.median
    assert "current [A]" in str(prognosis)


def test_the_prognosis_does_not_depend_on_the_indicators_unit_of_measure() -> None:
    indicator = Indicator("A", 2.0, 6.0, readings(2e-3, count=8), 320.0)
    scaled = tuple(Reading(x.hours, 1e3 * x.value, 1e6 * x.variance) for x in indicator.readings)
    other = Indicator("A", 2e3, 6e3, scaled, 320.0)
    assert prognose_indicator(indicator).sample == pytest.approx(prognose_indicator(other).sample, rel=1e-6)


def test_an_indicator_beyond_its_limit_has_no_remaining_life() -> None:
    prognosis = prognose_indicator(Indicator("A", 2.0, 4.0, readings(0.0, start=4.3, count=5), 160.0))
    assert prognosis.interval90 == (0.0, 0.0)
    assert prognosis.advice.action == "replace before"


def test_a_constant_healthy_indicator_has_no_failure_in_the_forecast() -> None:
    indicator = Indicator("A", 2.0, 6.0, readings(0.0), 1160.0)
    prognosis = prognose_indicator(indicator, Question(horizon=100.0), filter_settings=FEWER)
    assert math.isinf(prognosis.median)
    assert prognosis.probability_of_failure < 0.01


def test_fewer_than_three_readings_are_noted() -> None:
    prognosis = prognose_indicator(Indicator("A", 2.0, 6.0, readings(0.0, count=2), 1160.0))
    assert "readings: 2; 3 are needed" in prognosis.notes[0]


def test_the_rul_of_a_pure_wiener_process_agrees_with_its_closed_form() -> None:
    """With the linear law only, filter, forecast and first passage together give the closed form.

    The readings' errors are negligible, so the level is known; the rate has its posterior distribution. For a
    distance a to the limit, drift v and variance q² per hour: inverse Gaussian of mean a/v and shape a²/q².
    """
    scale, noise = 1000.0, 0.05
    settings = DegradationSettings(
        laws=(0, 1, 0, 0, 0),
        life_scale=(scale, scale + 1e-9),
        noise=noise,
        rate_noise=0.0,
        roughness=(1.0, 1.0 + 1e-12),
        unevenness=(1e-12, 1e-12),
        change_hours=1e15,
        breaks=0.0,
        new_level=1e-4,
    )
    times = np.arange(0.0, 40_001.0, 20.0)
    walk = np.random.default_rng(8).standard_normal(times.size - 1) * noise * math.sqrt(20.0 / scale)
    drift = 1e-4
    level = np.concatenate([[0.0], np.cumsum(walk + drift * 20.0)])
    used = level[: np.argmax(level > 0.2)]
    indicator = Indicator(
        "W",
        0.0,
        0.5,
        tuple(Reading(float(t), float(x), 1e-8) for t, x in zip(times, used, strict=False)),
        float(times[used.size - 1]),
    )
    prognosis = prognose_indicator(
        indicator,
        prior=Prior(settings),
        filter_settings=FilterSettings(particles=50),
        settings=ForecastSettings(paths=4000, longest_hours=60_000.0, steps=30),
    )
    # Posterior of the rate: mean slope of the walk, and the variance of that mean.
    span, q2 = float(times[used.size - 1]), noise**2 / scale
    precision = scale**2 + span / q2
    mean, deviation = (used[-1] / q2) / precision, precision**-0.5
    rates = norm.ppf((np.arange(100) + 0.5) / 100, mean, deviation)
    ahead = 0.5 - used[-1]
    uniform = np.linspace(0, 60_000, 1001)
    exact = np.mean([_passed(uniform, ahead, float(v), q2) for v in rates], axis=0)
    sample = np.minimum(prognosis.sample, 60_000.0)
    assert kstest(sample[sample < 60_000], lambda t: np.interp(t, uniform, exact) / exact[-1]).pvalue > 0.01
    assert np.mean(prognosis.sample < 60_000) == pytest.approx(exact[-1], abs=0.03)


def _passed(t: np.ndarray, a: float, v: float, q2: float) -> np.ndarray:
    """Return the probability that a Wiener process of drift `v`, of either sign, has passed `a` by `t`."""
    shape = a**2 / q2
    certain = invgauss(a / abs(v) / shape, scale=shape).cdf(t)
    return np.asarray(certain if v > 0 else certain * math.exp(2 * v * a / q2))


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: Reading(1.0, math.nan, 1.0),
        lambda: Reading(-1.0, 0.0, 1.0),
        lambda: Reading(1.0, 0.0, 0.0),
        lambda: Indicator("A", 1.0, 1.0, (), 5.0),
        lambda: Indicator("A", 1.0, 1.1, (Reading(4.0, 1.0, 0.04),), 5.0),
        lambda: Indicator("A", 1.0, math.inf, (), 5.0),
        lambda: Indicator("A", 1.0, 2.0, (Reading(6.0, 1.0, 1.0),), 5.0),
        lambda: Indicator("A", 1.0, 2.0, (), -5.0),
        lambda: Indicator("A", 1.0, 2.0, (), math.nan),
    ],
)
def test_invalid_readings_and_indicators_are_refused(wrong: object) -> None:
    with pytest.raises(PrognosisError):
        wrong()  # type: ignore[operator]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_readings_that_move_away_from_the_limit_are_noted(sign: float) -> None:
    """The readings end 2.3 A beyond the healthy value; the limit is 4 A away on the other side."""
    away = Indicator("A", 2.0, 2.0 - 4 * sign, readings(2e-3 * sign), 1160.0)
    assert [note for note in _notes(away) if "beyond healthy, away from the limit, by 5" in note]
    towards = Indicator("A", 2.0, 2.0 + 4 * sign, readings(2e-3 * sign), 1160.0)
    assert not [note for note in _notes(towards) if "beyond healthy" in note]


def test_readings_that_scatter_about_the_healthy_value_are_not_noted() -> None:
    random = np.random.default_rng(0)
    notes = 0
    for _ in range(200):
        level = 2.0 + 0.5 * random.standard_normal(20)
        still = Indicator(
            "A", 2.0, 4.0, tuple(Reading(10.0 * i, x, 0.25) for i, x in enumerate(level)), 200.0
        )
        notes += len(receding_notes(still))
    assert notes == 0  # four standard errors: 0.003 % of 200


def _notes(indicator: Indicator) -> tuple[str, ...]:
    return prognose_indicator(indicator, filter_settings=FEWER).notes
