"""Recalibration of a RUL from the outcomes of predictions of past units."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import ks_2samp

from emaphm.actuator import Actuator
from emaphm.actuator.faults import lower_bounds
from emaphm.actuator.requirements import Requirement
from emaphm.arrays import Array
from emaphm.errors import PrognosisError
from emaphm.prognosis import Evidence, Observation, Question, fleet_prior, prognose
from emaphm.prognosis.filter.following import follow
from emaphm.prognosis.from_fleet import record
from emaphm.prognosis.from_fleet.recalibration import (
    ForecastSituation,
    PastForecasts,
    Recalibration,
    log_rul,
    situation_of,
)
from emaphm.prognosis.from_fleet.record import FEWEST_FAILED
from emaphm.prognosis.metrics import Prediction, coverage, probability_integral_transform
from emaphm.prognosis.prior import NEW, Prior
from emaphm.prognosis.prognose import MOST_PAST, rul_forecasts, uncorrected
from emaphm.prognosis.requirements import Requirements
from emaphm.prognosis.settings import FORECAST, FilterSettings

LIMIT = 0.6
ACTUATOR = Actuator.thesis().model_copy(
    update={"requirements": (Requirement(component="friction", at_most=LIMIT),)}
)
FEW = replace(record.PATHS, paths=100)
ROUGH = replace(FEW, steps=30)
"""Settings for tests that do not depend on the values of a forecast."""
FIRST, SECOND = np.array([1.0, 0.0]), np.array([0.0, 1.0])


def forecasts(share: Array | float, spread: float = 0.3, first: Array = FIRST) -> ForecastSituation:
    """Return forecasts at shares of life; by default, the first of two limits fails first."""
    share = np.asarray(share)
    return ForecastSituation(
        share, np.full(share.shape, spread), np.broadcast_to(first, (*share.shape, first.size))
    )


def past(units: int, shift: float, size: float) -> Recalibration:
    """Return outcomes of predictions with normalised errors of mean `shift` and standard deviation `size`."""
    random = np.random.default_rng(0)
    shares = np.linspace(0.1, 0.9, 5)
    return Recalibration(
        [
            PastForecasts(f"U{i}", forecasts(shares), shift + size * random.standard_normal(5))
            for i in range(units)
        ]
    )


@pytest.mark.evidence
def test_corrected_predictions_have_the_stated_coverage() -> None:
    random = np.random.default_rng(1)
    recalibration = past(300, -0.8, 2.0)
    before, after = [], []
    for _ in range(400):
        median, spread = float(random.uniform(200, 2000)), float(random.uniform(0.1, 0.4))
        first = median * np.exp(spread * random.standard_normal(500))
        true = median * np.exp(spread * (-0.8 + 2.0 * random.standard_normal()))
        never = np.full(first.size, np.inf)
        corrected = recalibration.corrected(np.stack([first, never]), age=1000.0)[0]
        before.append(probability_integral_transform(Prediction(0.0, first), true))
        after.append(probability_integral_transform(Prediction(0.0, corrected), true))
    assert coverage(before) < 0.65
    # Four standard errors of 400 truths, 0.06.
    assert coverage(after) == pytest.approx(0.9, abs=0.06)
    assert np.mean(np.array(after) < 0.5) == pytest.approx(0.5, abs=0.1)


def test_few_past_units_give_a_weak_correction_and_none_gives_no_correction() -> None:
    shift, size = past(5, 1.0, 0.0).correction(forecasts(0.5))
    assert shift == pytest.approx(0.5)  # five units have the same weight as no correction
    assert Recalibration([]).correction(forecasts(0.5)) == (0.0, 1.0)
    assert past(200, 1.0, 0.0).correction(forecasts(0.5))[0] == pytest.approx(1.0, abs=0.05)
    assert size < 1.0


def test_corrections_early_in_life_do_not_apply_late_in_life() -> None:
    early = PastForecasts("A", forecasts(np.full(5, 0.1)), np.full(5, 2.0))
    late = PastForecasts("B", forecasts(np.full(5, 0.9)), np.full(5, -2.0))
    both = Recalibration([early, late])
    assert both.correction(forecasts(0.1))[0] > 0 > both.correction(forecasts(0.9))[0]
    assert both.without("A").correction(forecasts(0.9))[0] < 0


def test_bad_predictions_of_one_component_do_not_widen_good_ones_of_another() -> None:
    random = np.random.default_rng(3)
    shares = np.full(5, 0.5)
    good = [PastForecasts(f"A{i}", forecasts(shares), 0.3 * random.standard_normal(5)) for i in range(15)]
    bad = [
        PastForecasts(f"B{i}", forecasts(shares, first=SECOND), 3.0 * random.standard_normal(5))
        for i in range(15)
    ]
    recalibration = Recalibration([*good, *bad])
    _, size_for_good = recalibration.correction(forecasts(0.5))
    _, size_for_bad = recalibration.correction(forecasts(0.5, first=SECOND))
    _, size_for_either = recalibration.correction(forecasts(0.5, first=(FIRST + SECOND) / 2))
    assert size_for_good < 1 < min(size_for_either, size_for_bad)


def test_narrow_predictions_are_corrected_by_past_narrow_predictions() -> None:
    random = np.random.default_rng(4)
    shares = np.full(5, 0.5)
    certain = [
        PastForecasts(f"A{i}", forecasts(shares, 0.05), 3.0 * random.standard_normal(5)) for i in range(15)
    ]
    uncertain = [
        PastForecasts(f"B{i}", forecasts(shares, 0.8), 0.3 * random.standard_normal(5)) for i in range(15)
    ]
    recalibration = Recalibration([*certain, *uncertain])
    assert (
        recalibration.correction(forecasts(0.5, 0.05))[1]
        > 1
        > recalibration.correction(forecasts(0.5, 0.8))[1]
    )


def test_the_situation_of_a_forecast_has_its_share_of_life_and_first_limits() -> None:
    hours = np.array([[100.0, 200.0, np.inf, 400.0], [300.0, 150.0, np.inf, np.inf]])
    situation = situation_of(hours, age=275.0)
    assert situation.share == pytest.approx(0.5)
    assert situation.first.tolist() == [0.5, 0.25]


def test_a_record_for_other_requirements_is_refused() -> None:
    with pytest.raises(PrognosisError, match="other requirements"):
        past(5, 1.0, 1.0).corrected(np.full((3, 10), 100.0), age=100.0)


def test_a_correction_keeps_the_order_of_lives_and_failed_and_unlimited_lives() -> None:
    first = np.array([0.0, 5.0, 100.0, 300.0, 800.0, np.inf])
    never = np.full(first.size, np.inf)
    corrected = past(50, 0.5, 1.5).corrected(np.stack([first, never]), age=500.0)[0]
    assert corrected[0] == 0.0
    assert np.isinf(corrected[-1])
    assert np.all(np.diff(corrected[:-1]) > 0)
    ended, endless = np.zeros(20), np.full(20, np.inf)
    for lives_of_paths in (ended, endless):
        both = np.stack([lives_of_paths, lives_of_paths])
        assert past(50, 0.5, 1.5).corrected(both, age=500.0).tolist() == both.tolist()
        assert not np.isfinite(log_rul(lives_of_paths)[0])


def saturating(hours: Array | float) -> Array:
    """Return a level that follows no law of the filter: two rises with a pause between them."""
    share = np.asarray(hours) / 2000.0
    return np.asarray(
        0.33 / (1 + np.exp(-(share - 0.25) / 0.05)) + 0.33 / (1 + np.exp(-(share - 0.9) / 0.05))
    )


def flown(time: float, seed: int, upto: float | None = None) -> Evidence:
    """Return diagnoses of a unit whose friction follows `saturating`, with its time scaled by `time`."""
    random = np.random.default_rng(seed)
    hours = np.arange(0.0, 4000.0 * time, 1.0)
    failure = float(hours[np.argmax(saturating(hours / time) >= LIMIT)])
    observations = []
    for at_hours in np.arange(100.0, upto or failure, 100.0):
        level = NEW + 0.005 * random.standard_normal(8)
        level[0] += saturating(at_hours / time)
        observations.append(Observation(float(at_hours), level, 0.005**2 * np.eye(8), np.ones(8, bool)))
    last = observations[-1].hours
    return Evidence(f"unit {seed}", "part", last, tuple(observations), failures=(failure,))


@pytest.fixture(scope="module")
def fleet() -> list[Evidence]:
    times = np.exp(0.2 * np.random.default_rng(1).standard_normal(6))
    return [flown(float(time), i) for i, time in enumerate(times)]


@pytest.fixture(scope="module")
def sparse(fleet: list[Evidence]) -> list[Evidence]:
    """Return the fleet with every fourth diagnosis, for tests that do not depend on forecast values."""
    return [replace(evidence, observations=evidence.observations[::4]) for evidence in fleet]


@pytest.mark.evidence
def test_a_fleet_makes_degradation_predictable_that_follows_no_law_of_the_filter(
    fleet: list[Evidence], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(record, "PATHS", FEW)
    monkeypatch.setattr(record, "AT", (0.5, 0.8))
    prior = fleet_prior(fleet, actuator=ACTUATOR)
    assert prior.recalibration is not None
    assert sorted(outcome.unit for outcome in prior.recalibration.outcomes) == [f"unit {i}" for i in range(6)]
    new = flown(1.1, 99, upto=1150.0)
    true = new.failures[0] - new.hours
    by_fleet = prognose(new, ACTUATOR, Question(), prior=prior).interval90
    alone = prognose(new, ACTUATOR, Question()).interval90
    assert by_fleet[1] is not None
    assert by_fleet[0] < true < by_fleet[1]
    assert by_fleet[1] - by_fleet[0] < 0.5 * ((alone[1] or 20_000.0) - alone[0])


def test_forecasts_of_several_times_together_agree_with_separate_forecasts(fleet: list[Evidence]) -> None:
    past = follow(fleet[0], Prior(), settings=FilterSettings(particles=200)).past
    chosen = [past[5], past[-1]]
    settings = replace(FORECAST, paths=300, steps=40)
    together = uncorrected(chosen, fleet[0], ACTUATOR, settings)
    for times, (_, one) in zip(
        together, rul_forecasts(chosen, fleet[0], ACTUATOR, settings=settings), strict=True
    ):
        assert times.first.shape == one.shape
        assert ks_2samp(times.first, one).pvalue > 0.01


def test_past_units_are_predicted_only_once(sparse: list[Evidence], monkeypatch: pytest.MonkeyPatch) -> None:
    predicted: list[str] = []

    def outcome(evidence: Evidence, *_: Any) -> PastForecasts:
        predicted.append(evidence.unit)
        return PastForecasts(evidence.unit, forecasts(np.array([0.5])), np.array([0.0]))

    monkeypatch.setattr(record, "_outcome", outcome)
    # Neither a unit that still works nor its next diagnosis causes new predictions.
    for upto in (400.0, 500.0):
        working = replace(flown(1.0, 50, upto=upto), failures=())
        fleet_prior([*sparse[:FEWEST_FAILED], working], seed=7, actuator=ACTUATOR)
    assert sorted(predicted) == sorted(evidence.unit for evidence in sparse[:FEWEST_FAILED])


@pytest.mark.parametrize(
    "described",
    [
        # Another least friction, and with no stated requirements another list of limits.
        {"faults": ACTUATOR.faults.model_copy(update={"friction": 6.0})},
        {"requirements": (), "mechanics": ACTUATOR.mechanics.model_copy(update={"backlash": 0.0})},
    ],
)
def test_past_units_are_predicted_for_each_description(
    sparse: list[Evidence], monkeypatch: pytest.MonkeyPatch, described: dict[str, Any]
) -> None:
    def outcome(evidence: Evidence, _: Prior, actuator: Actuator, __: int) -> PastForecasts:
        limits = len(Requirements(actuator).limits)
        first = np.full(limits, lower_bounds(actuator)[0])
        return PastForecasts(evidence.unit, forecasts(np.array([0.5]), first=first), np.array([0.0]))

    monkeypatch.setattr(record, "_outcome", outcome)
    failed, actuator = sparse[:FEWEST_FAILED], ACTUATOR.model_copy(update=described)
    whole = ACTUATOR.model_copy(update={"requirements": ()})
    for before in (ACTUATOR, whole):
        fleet_prior(failed, seed=8, actuator=before)
    recalibration = fleet_prior(failed, seed=8, actuator=actuator).recalibration
    assert recalibration is not None
    first = recalibration.outcomes[0].situations.first
    assert first.shape == (1, len(Requirements(actuator).limits))
    assert (first == lower_bounds(actuator)[0]).all()


def test_a_unit_diagnosed_only_at_its_failure_gives_no_correction(
    sparse: list[Evidence], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(record, "PATHS", ROUGH)
    monkeypatch.setattr(record, "AT", (0.5,))
    failed, known = sparse[:FEWEST_FAILED], sparse[0]
    failed_at = known.observations[-1].hours
    # All three diagnoses are of one day, so no earlier forecast of the unit exists.
    at_once = replace(known, unit="at once", observations=known.observations[-1:] * 3, failures=(failed_at,))
    recalibration = fleet_prior([*failed, at_once], seed=7, actuator=ACTUATOR).recalibration
    assert recalibration is not None
    assert {outcome.unit for outcome in recalibration.outcomes} == {unit.unit for unit in failed}


def test_a_fleet_without_failures_gives_no_correction(sparse: list[Evidence]) -> None:
    working = [replace(evidence, failures=()) for evidence in sparse[:3]]
    assert fleet_prior(working, actuator=ACTUATOR).recalibration is None
    assert fleet_prior(working).recalibration is None


def test_predictions_are_compared_with_the_failure_that_ended_the_same_life() -> None:
    """Failures are at 900 and 2,000 h; a replacement at 1,300 h ends the predicted life before the second."""
    hours = np.arange(100.0, 2400.0, 100.0)
    observations = tuple(Observation(float(at), NEW, np.eye(8), np.ones(8, bool)) for at in hours)
    replacements = ((900.0, "friction"), (1300.0, "backlash"), (2000.0, "unit"))
    unit = Evidence("A", "part", 2300.0, observations, replacements, failures=(900.0, 2000.0))
    chosen = record._predicted_observations(unit, ())
    failure_of = {float(hours[i]): failure for i, failure in chosen.items()}
    assert set(failure_of.values()) == {900.0, 2000.0}
    assert all(predicted_at <= 900.0 for predicted_at, failure in failure_of.items() if failure == 900.0)
    assert all(
        1300.0 < predicted_at <= 2000.0 for predicted_at, failure in failure_of.items() if failure == 2000.0
    )
    assert list(chosen) == sorted(chosen)


def test_past_beliefs_are_limited_in_number_and_optional(fleet: list[Evidence]) -> None:
    many, few = (replace(fleet[0], observations=fleet[0].observations[:n]) for n in (MOST_PAST + 2, 3))
    assert len(many.used) > MOST_PAST
    kept = prognose(many, ACTUATOR, settings=ROUGH).past
    assert len(kept) == MOST_PAST
    assert [kept[0].hours, kept[-1].hours] == [many.used[0].hours, many.used[-1].hours]
    assert len(prognose(few, ACTUATOR, settings=ROUGH).past) == 3
    assert prognose(few, ACTUATOR, settings=ROUGH, keep_past=False).past == ()
