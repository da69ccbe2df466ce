"""Advice from the accepted risk, and the cheapest replacement age against a brute-force search."""

import math

import numpy as np
import pytest

from emaphm.errors import PrognosisError
from emaphm.prognosis import Costs, Question
from emaphm.prognosis.advice import Advice, advice, without_followed_rates, without_observed_violation
from emaphm.prognosis.wording.sentences import advice_text


def test_a_unit_flies_on_while_its_risk_is_below_the_accepted_risk() -> None:
    sample = np.linspace(500, 1500, 1001)
    advised = advice(sample, 400.0, risk=0.05)
    assert (advised.action, advised.hours, advised.risk) == ("fly on", 400.0, 0.0)


def test_replacement_is_advised_at_the_quantile_of_the_rul_for_the_accepted_risk() -> None:
    sample = np.linspace(500, 1500, 1001)
    advised = advice(sample, 2000.0, risk=0.05)
    assert advised.action == "replace before"
    assert advised.hours == pytest.approx(550.0)
    assert advised.risk == pytest.approx(0.05, abs=0.002)
    assert advised.risk <= 0.05


def test_the_stated_risk_is_the_share_of_failed_paths() -> None:
    """Of 1,000 paths, 600 have failed, or 300 have, or 50 fail before the first path that exceeds 5 %."""
    sample = np.linspace(1, 1000, 1000)
    for failed, expected in ((600, 0.6), (300, 0.3), (20, 0.05)):
        advised = advice(np.where(sample <= failed, 0.0, sample), 900.0, risk=0.05)
        assert advised.risk == expected, failed


def test_the_reason_states_that_the_number_of_paths_is_too_small_for_the_risk() -> None:
    sample = np.linspace(100, 1000, 1000)
    advised = advice(sample, 5000.0, risk=1e-4)
    assert (advised.hours, advised.risk) == (100.0, 0.0)
    assert "the first of 1000 paths, too few for a risk of 0.01 %, fails then" in advised.reason
    assert "paths" not in advice(sample, 5000.0, risk=1e-3).reason


def test_a_wide_distribution_of_the_rul_leads_to_an_inspection() -> None:
    advised = advice(np.geomspace(10, 10_000, 1000), 2000.0, risk=0.05)
    assert advised.action == "inspect by"
    assert advised.hours < 20


def test_a_violated_requirement_leads_to_an_immediate_replacement() -> None:
    advised = advice(np.zeros(10), 100.0, risk=0.05)
    assert (advised.action, advised.hours, advised.risk) == ("replace before", 0.0, 1.0)


def test_the_reason_states_the_probability_of_a_violation_that_is_not_certain() -> None:
    sample = np.linspace(1, 1000, 1000)
    for failed, action, stated in (
        (960, "replace before", "a requirement is violated already"),
        (600, "replace before", "a requirement is violated already with a probability of 60 %"),
        (
            300,
            "inspect by",
            "the risk exceeds 5 % now: a requirement is violated already with a probability of",
        ),
    ):
        advised = advice(np.where(sample <= failed, 0.0, sample), 900.0, risk=0.05)
        assert (advised.action, advised.hours) == (action, 0.0)
        assert advised.reason.startswith(stated)
        assert ("probability" in advised.reason) == (failed < 960)


def test_a_violation_that_no_diagnosis_shows_leads_to_an_inspection() -> None:
    forecast = Advice("replace before", 0.0, 0.6, "a requirement is violated already")
    advised = without_observed_violation(forecast, 100.0)
    assert (advised.action, advised.hours, advised.risk) == ("inspect by", 0.0, 0.6)
    assert "forecast from the diagnosis of 100 h" in advised.reason
    certain = Advice("replace before", 0.0, 0.97, "a requirement is violated already")
    assert without_observed_violation(certain, 100.0) == certain
    assert without_observed_violation(certain, None).action == "inspect by"
    later = Advice("replace before", 10.0, 0.05, "why")
    assert without_observed_violation(later, None) == later


def test_a_unit_without_a_failure_in_the_forecast_flies_on() -> None:
    for costs in (None, Costs(10.0, 1.0)):
        advised = advice(np.full(10, math.inf), 100.0, risk=0.05, costs=costs)
        assert (advised.action, advised.risk) == ("fly on", 0.0)
        assert advised.reason.endswith("nowhere in the forecast")


def test_the_cheapest_replacement_age_agrees_with_barlow_and_hunter() -> None:
    """For Weibull lives of new units, the age agrees with a search over the closed form of the cost rate."""
    shape, scale, failure, planned = 3.0, 1000.0, 10.0, 1.0
    n = 20_000
    sample = scale * (-np.log(1 - (np.arange(n) + 0.5) / n)) ** (1 / shape)
    ages = np.linspace(50, 2000, 3901)
    survival = np.exp(-((ages / scale) ** shape))
    mean = np.concatenate([[0], np.cumsum((survival[1:] + survival[:-1]) / 2 * np.diff(ages))]) + 50
    exact = ages[np.argmin((planned * survival + failure * (1 - survival)) / mean)]
    advised = advice(sample, 5000.0, risk=0.5, costs=Costs(failure, planned))
    assert advised.hours == pytest.approx(exact, rel=0.03)


@pytest.mark.evidence
def test_the_mean_stated_risk_agrees_with_the_risk_of_the_distribution() -> None:
    """The advice is computed from samples of lives; the true risk follows from their known distribution."""
    stated, true = [], []
    for seed in range(400):
        sample = 1000.0 * np.random.default_rng(seed).weibull(3.0, 200)
        advised = advice(sample, 1e5, risk=0.05, costs=Costs(1e6, 1.0))
        stated.append(advised.risk)
        true.append(-math.expm1(-((advised.hours / 1000.0) ** 3)))
    assert min(stated) == pytest.approx(1 / 201)
    # The first failures have risks of standard error 1 / sqrt(k): four of them, of 400 samples.
    assert np.mean(true) == pytest.approx(np.mean(stated), rel=0.2)


def test_the_reason_states_that_the_number_of_paths_is_too_small_for_the_costs() -> None:
    sample = np.sort(np.random.default_rng(0).normal(1000.0, 100.0, 1000))
    advised = advice(sample, 5000.0, risk=0.05, costs=Costs(1e6, 1.0))
    assert (advised.action, advised.hours) == ("replace before", sample[0])
    assert advised.risk == pytest.approx(1 / 1001)
    assert advised.reason == (
        "by the first of 1000 paths, too few for so small a risk, a replacement is cheaper then"
    )
    # Where a failure costs ten replacements, more than three of the paths fail before the advised time.
    advised = advice(sample, 5000.0, risk=0.05, costs=Costs(10.0, 1.0))
    assert advised.reason == "a replacement is cheaper then"
    assert advised.risk > 3 / 1001
    # All paths fail at the same time, so that time is certain.
    advised = advice(np.full(1000, 700.0), 5000.0, risk=0.05, costs=Costs(1e6, 1.0))
    assert (advised.hours, advised.reason) == (700.0, "a replacement is cheaper then")


def test_no_preventive_replacement_is_advised_for_a_constant_or_falling_hazard() -> None:
    """Barlow and Hunter: with a constant or falling hazard, the cheapest age is infinite."""
    for shape in (1.0, 0.7):
        for seed in range(20):
            sample = 800.0 * np.random.default_rng(seed).weibull(shape, 1000)
            advised = advice(sample, 1e5, risk=0.05, costs=Costs(10.0, 1.0))
            assert (advised.action, advised.hours) == ("fly on", 1e5), (shape, seed)
    growing = 800.0 * np.random.default_rng(0).weibull(1.5, 1000)
    assert advice(growing, 1e5, risk=0.05, costs=Costs(10.0, 1.0)).action == "replace before"


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: Costs(-1.0, 1.0),
        lambda: Costs(math.nan, 1.0),
        lambda: Costs(1.0, 2.0),
        lambda: Costs(1.0, 0.0),
        lambda: Question(horizon=0.0),
        lambda: Question(horizon=math.inf),
        lambda: Question(risk=0.0),
        lambda: Question(risk=1.5),
    ],
)
def test_costs_horizons_and_risks_out_of_range_are_refused(wrong: object) -> None:
    with pytest.raises(PrognosisError):
        wrong()  # type: ignore[operator]


def test_a_small_risk_is_not_rounded_to_zero() -> None:
    texts = [advice_text(Advice("fly on", 100.0, risk, "why"), 0.0) for risk in (0.0, 4e-4, 2e-3, 0.1234)]
    stated = [text.split("risk of ")[1] for text in texts]
    assert stated == ["0.0 % (why)", "0.04 % (why)", "0.2 % (why)", "12.3 % (why)"]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (
            Advice("fly on", 1000.0, 0.0, "why"),
            "fly on for 1,000 h more, until 3,500 h, at a risk of 0.0 % (why)",
        ),
        (
            Advice("inspect by", 42.0, 0.05, "why"),
            "inspect within 42 h, by 2,542 h, at a risk of 5.0 % (why)",
        ),
        (
            Advice("replace before", 42.0, 0.05, "why"),
            "replace within 42 h, before 2,542 h, at a risk of 5.0 %",
        ),
        (Advice("replace before", 0.0, 0.9, "why"), "replace now (why)"),
        (Advice("inspect by", 0.0, 0.0, "why"), "inspect now (why)"),
    ],
)
def test_advice_states_the_hours_from_now_and_the_flight_hours(given: Advice, words: str) -> None:
    assert advice_text(given, 2500.0).startswith(words)


def test_levels_that_change_too_fast_for_the_forecast_are_inspected_now_unless_replaced_now() -> None:
    fly_on = Advice("fly on", 100.0, 0.01, "the risk exceeds 5 % beyond the horizon")
    inspected = without_followed_rates(fly_on, "backlash by 0.25", 0.0)
    assert (inspected.action, inspected.hours, inspected.risk) == ("inspect by", 0.0, 0.0)
    assert "backlash by 0.25" in inspected.reason
    replaced = Advice("replace before", 0.0, 1.0, "a requirement is violated already")
    assert without_followed_rates(replaced, "backlash by 0.25", 1.0) is replaced
