"""Advice: what the risk allows, and the cheapest age of replacement against a brute-force search."""

import math

import numpy as np
import pytest

from emaphm.errors import PrognosisError
from emaphm.prognosis import Costs, Question
from emaphm.prognosis.advice import Advice, advice
from emaphm.prognosis.wording.sentences import advice_text


def test_a_unit_flies_on_while_the_risk_allows() -> None:
    sample = np.linspace(500, 1500, 1001)
    given = advice(sample, 400.0, risk=0.05)
    assert (given.action, given.hours, given.risk) == ("fly on", 400.0, 0.0)


def test_a_unit_of_known_life_is_replaced_before_the_risk_is_too_large() -> None:
    sample = np.linspace(500, 1500, 1001)
    given = advice(sample, 2000.0, risk=0.05)
    assert given.action == "replace before"
    assert given.hours == pytest.approx(550.0)
    assert given.risk == pytest.approx(0.05, abs=0.002)
    assert given.risk <= 0.05


def test_the_risk_that_is_stated_is_that_of_the_sample() -> None:
    """Of 1,000 paths: 600 have failed, 300 have, and 50 fail before the one that exceeds 5 %."""
    sample = np.linspace(1, 1000, 1000)
    for failed, expected in ((600, 0.6), (300, 0.3), (20, 0.05)):
        given = advice(np.where(sample <= failed, 0.0, sample), 900.0, risk=0.05)
        assert given.risk == expected, failed


def test_a_risk_that_the_paths_do_not_resolve_is_said_to_be_one() -> None:
    sample = np.linspace(100, 1000, 1000)
    given = advice(sample, 5000.0, risk=1e-4)
    assert (given.hours, given.risk) == (100.0, 0.0)
    assert "the first of 1000 paths, too few for a risk of 0.01 %, fails then" in given.reason
    assert "paths" not in advice(sample, 5000.0, risk=1e-3).reason


def test_where_little_is_known_an_inspection_comes_first() -> None:
    given = advice(np.geomspace(10, 10_000, 1000), 2000.0, risk=0.05)
    assert given.action == "inspect by"
    assert given.hours < 20


def test_what_is_violated_is_replaced_now() -> None:
    given = advice(np.zeros(10), 100.0, risk=0.05)
    assert (given.action, given.hours, given.risk) == ("replace before", 0.0, 1.0)


def test_no_failure_in_sight_is_no_reason_to_land() -> None:
    for costs in (None, Costs(10.0, 1.0)):
        given = advice(np.full(10, math.inf), 100.0, risk=0.05, costs=costs)
        assert (given.action, given.risk) == ("fly on", 0.0)
        assert given.reason.endswith("nowhere in the forecast")


def test_the_cheapest_replacement_is_that_of_barlow_and_hunter() -> None:
    """A sample of Weibull lives, new units: the age that a search over the closed form of the cost finds."""
    shape, scale, failure, planned = 3.0, 1000.0, 10.0, 1.0
    n = 20_000
    sample = scale * (-np.log(1 - (np.arange(n) + 0.5) / n)) ** (1 / shape)
    ages = np.linspace(50, 2000, 3901)
    survival = np.exp(-((ages / scale) ** shape))
    mean = np.concatenate([[0], np.cumsum((survival[1:] + survival[:-1]) / 2 * np.diff(ages))]) + 50
    exact = ages[np.argmin((planned * survival + failure * (1 - survival)) / mean)]
    given = advice(sample, 5000.0, risk=0.5, costs=Costs(failure, planned))
    assert given.hours == pytest.approx(exact, rel=0.03)


@pytest.mark.evidence
def test_the_risk_that_costs_accept_is_on_the_mean_that_of_the_distribution() -> None:
    """The advice is given from samples of known lives; their distribution says what its risk really is."""
    stated, true = [], []
    for seed in range(400):
        sample = 1000.0 * np.random.default_rng(seed).weibull(3.0, 200)
        given = advice(sample, 1e5, risk=0.05, costs=Costs(1e6, 1.0))
        stated.append(given.risk)
        true.append(-math.expm1(-((given.hours / 1000.0) ** 3)))
    assert min(stated) == pytest.approx(1 / 201)
    # The first failures have risks of standard error 1 / sqrt(k): four of them, of 400 samples.
    assert np.mean(true) == pytest.approx(np.mean(stated), rel=0.2)


def test_costs_that_the_paths_do_not_resolve_are_said_to_be_so() -> None:
    sample = np.sort(np.random.default_rng(0).normal(1000.0, 100.0, 1000))
    given = advice(sample, 5000.0, risk=0.05, costs=Costs(1e6, 1.0))
    assert (given.action, given.hours) == ("replace before", sample[0])
    assert given.risk == pytest.approx(1 / 1001)
    assert given.reason == (
        "by the first of 1000 paths, too few for so small a risk, a replacement is cheaper then"
    )
    # With a failure of ten replacements, more than three of the paths fail until then.
    given = advice(sample, 5000.0, risk=0.05, costs=Costs(10.0, 1.0))
    assert given.reason == "a replacement is cheaper then"
    assert given.risk > 3 / 1001
    # All fail at once: that time is known.
    given = advice(np.full(1000, 700.0), 5000.0, risk=0.05, costs=Costs(1e6, 1.0))
    assert (given.hours, given.reason) == (700.0, "a replacement is cheaper then")


def test_where_the_hazard_does_not_grow_no_replacement_is_cheaper() -> None:
    """Barlow and Hunter: with a constant or falling hazard, the cheapest age is infinite."""
    for shape in (1.0, 0.7):
        for seed in range(20):
            sample = 800.0 * np.random.default_rng(seed).weibull(shape, 1000)
            given = advice(sample, 1e5, risk=0.05, costs=Costs(10.0, 1.0))
            assert (given.action, given.hours) == ("fly on", 1e5), (shape, seed)
    grows = 800.0 * np.random.default_rng(0).weibull(1.5, 1000)
    assert advice(grows, 1e5, risk=0.05, costs=Costs(10.0, 1.0)).action == "replace before"


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
def test_costs_and_probabilities_out_of_range_are_refused(wrong: object) -> None:
    with pytest.raises(PrognosisError):
        wrong()  # type: ignore[operator]


def test_a_small_risk_is_not_written_as_none() -> None:
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
def test_advice_has_the_hours_from_now_and_the_flight_hours(given: Advice, words: str) -> None:
    assert advice_text(given, 2500.0).startswith(words)
