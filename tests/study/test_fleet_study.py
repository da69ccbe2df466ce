"""The study of predictions for a synthetic fleet: simple alternatives, scores, and the page."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from cases import THESIS
from emaphm.actuator.faults import HEALTHY, to_cartesian
from emaphm.actuator.requirements import Requirement
from emaphm.fleet.synthetic import FleetPlan, drawn_unit
from emaphm.prognosis import Evidence, Observation
from emaphm.prognosis.filter.following import LEAST_ERROR
from emaphm.prognosis.stress import Stress, StressPiece
from emaphm.random_streams import stream
from emaphm.report.fleet.page import fleet_page
from emaphm.study.fleet import informed as informed_module
from emaphm.study.fleet.acting import PolicyOutcome, acted, outcome, over_life
from emaphm.study.fleet.baselines import fleet_lives, last_slope, mean_life, one_filter_a_component
from emaphm.study.fleet.diagnoses import Quality, quality
from emaphm.study.fleet.drawn import DiagnosisPool, drawn_evidence
from emaphm.study.fleet.informed import Component, informed, rates_ahead, recorded_stretches
from emaphm.study.fleet.judging import SHARES, WAYS, WITH_FLEET
from emaphm.study.fleet.run import DRAWN, PARTS, PLAN, RECORDED, without_part
from emaphm.study.fleet.scores import alpha_lambda_interval, scores, warnings
from emaphm.study.fleet.tracks import BY_COSTS, BY_RISK, BY_RISK_OR_INSPECTED, track

ACTUATOR = THESIS.model_copy(
    update={
        "requirements": (
            Requirement(component="friction", at_most=0.6),
            Requirement(component="gain", at_least=0.3),
        )
    }
)
NEW = to_cartesian(HEALTHY.vector)


def straight(rate: float, gain_rate: float = 0.0, error: float = 1e-3) -> Evidence:
    """Return diagnoses of a unit whose friction rises linearly and whose gain falls linearly."""
    observations = []
    for hours in np.arange(100.0, 1001.0, 100.0):
        level = NEW.copy()
        level[0] += rate * hours
        level[7] -= gain_rate * hours
        observations.append(Observation(float(hours), level, error**2 * np.eye(8), np.ones(8, bool)))
    return Evidence("synthetic", "synthetic", 1000.0, tuple(observations))


def test_the_last_slope_is_exact_on_a_straight_line() -> None:
    assert last_slope(straight(3e-4), ACTUATOR) == pytest.approx([1000.0])
    assert last_slope(straight(3e-4, 1.5e-4), ACTUATOR) == pytest.approx([0.2 / 1.5e-4 - 1000.0])
    assert np.isinf(last_slope(straight(-1e-4), ACTUATOR))


def test_one_filter_per_component_extrapolates_a_straight_line() -> None:
    sample = one_filter_a_component(straight(3e-4), ACTUATOR, seed=0)
    assert np.median(sample) == pytest.approx(1000.0, rel=0.05)
    assert 200.0 < np.diff(np.quantile(sample, (0.05, 0.95)))[0] < 1000.0


def test_the_mean_life_is_that_of_the_units_with_a_longer_life() -> None:
    assert mean_life(1000.0, [500.0, 1500.0, 2500.0]) == pytest.approx([1000.0])
    assert mean_life(3000.0, [500.0, 1500.0, 2500.0]) == pytest.approx([0.0])
    assert fleet_lives(1000.0, [500.0, 1500.0, 2500.0]) == pytest.approx([500.0, 1500.0])


def test_drawn_diagnoses_have_the_stated_errors() -> None:
    plan = FleetPlan(units=1, flights=400, interval=2.0)
    unit = drawn_unit(plan, 0)
    deviations = np.linspace(0.002, 0.016, 8)
    pool = DiagnosisPool(NEW[np.newaxis], np.diag(deviations**2)[np.newaxis])
    evidence = drawn_evidence(unit, plan, pool)
    errors = np.array(
        [
            observation.level - to_cartesian(unit.vectors[unit.row(observation.hours)])
            for observation in evidence.observations
        ]
    )
    assert errors.std(axis=0) == pytest.approx(deviations, rel=0.15)
    accuracy = quality([(unit, evidence)])
    assert accuracy.error == pytest.approx(np.sqrt(np.mean(deviations**2)), rel=0.05)
    assert accuracy.coverage == pytest.approx(0.954, abs=0.015)


def made_up(unit: int, *, good: bool) -> dict[str, Any]:
    """Return a result like that of `judged` for a unit whose predictions are all good or all late."""
    forecast = {
        "hours": 100.0,
        "true": 1000.0,
        "median": 1000.0 if good else 1500.0,
        "low": 500.0,
        "high": 2000.0,
        "good": good,
        "transform": 0.5 if good else 0.01,
        "crps": 100.0 if good else 400.0,
        "certain": False,
    }
    samples = (100.0, np.linspace(500.0, 1500.0, 101)), (600.0, np.linspace(300.0, 700.0, 101))
    late = (100.0, np.full(101, 5000.0)), (600.0, np.full(101, 4500.0))
    return {
        "unit": f"SYNTHETIC-{unit}",
        "failure": 1100.0,
        "failed": "friction",
        "law": "logistic",
        "diagnoses": 10,
        "explained": 10,
        "ways": {method: {str(share): forecast for share in SHARES} for method in WAYS},
        "tracks": {method: track(samples if good else late, 1100.0, 100.0) for method in WAYS},
    }


def test_each_unit_is_judged_once_with_a_fleet_prior_without_this_unit() -> None:
    units = list(range(PLAN.units))
    parted = [without_part(units, part) for part in range(PARTS)]
    assert sorted(unit for judged, _ in parted for unit in judged) == units
    for judged, fleet in parted:
        assert sorted([*judged, *fleet]) == units
        assert len(judged) == 8


def test_scores_count_units() -> None:
    units = [made_up(i, good=i < 3) for i in range(4)]
    result = scores(units, WITH_FLEET, 0.5)
    assert (result.alpha_lambda, result.coverage, result.late, result.crps) == (0.75, 0.75, 0.25, 175.0)
    assert (result.error, result.width) == (0.0, 1.5)
    assert warnings(units, WITH_FLEET) == pytest.approx([5 / 11, 5 / 11, 5 / 11, 0.0])
    # Of 3 of 4 units, by scipy.stats.binomtest(3, 4).proportion_ci(0.9, "wilson").
    assert alpha_lambda_interval(result) == pytest.approx((0.35617, 0.94209), abs=5e-5)


def test_a_unit_is_removed_if_it_must_not_fly_until_the_next_check_flight() -> None:
    """`soon`: failures spread evenly from 49 to 1,049 h from now, so that 5.1 % come within 100 h.

    Cost per hour until t, at an age a: (1 + 9 F) / (a + E[min(RUL, t)]). At a = 200 h, 1 / 249 before any
    unit can fail and 1.46 / 299 until 100 h; at a = 10 h, 1 / 59 and 1.46 / 109: a young unit flies on.
    """
    soon, later = np.linspace(49.0, 1049.0, 1001), np.linspace(151.0, 1150.0, 1000)
    old = track([(100.0, later), (200.0, soon)], 900.0, 100.0)["removed"]
    assert (old[BY_RISK], old[BY_COSTS]) == (200.0, 200.0)
    young = track([(10.0, soon)], 900.0, 100.0)["removed"]
    assert (young[BY_RISK], young[BY_COSTS]) == (10.0, None)
    # The median, 549 h, is more than three times the time allowed by the risk: an inspection is advised.
    assert (young[BY_RISK_OR_INSPECTED], old[BY_RISK_OR_INSPECTED]) == (None, None)


def test_a_prediction_of_a_single_number_is_taken_as_certain() -> None:
    samples = [(hours, np.array([490.0 - hours])) for hours in (100.0, 200.0, 300.0, 400.0)]
    removed = track(samples, 450.0, 100.0)["removed"]
    assert (removed[BY_RISK], removed[BY_COSTS]) == (400.0, 400.0)


def test_predictions_over_a_life_are_scored_as_defined() -> None:
    """Two check flights: one correct, one 150 % late that predicts no failure within 400 h."""
    samples = (100.0, np.full(11, 500.0)), (400.0, np.full(11, 500.0))
    result = over_life([{"failure": 600.0, "tracks": {"way": track(samples, 600.0, 100.0)}}], "way")
    assert (result.brier, result.late) == (0.5, 0.5)
    assert (result.first, result.lasting) == pytest.approx((500 / 600, 0.0))
    assert result.accuracy == pytest.approx((1.0 - 0.5) / 2)


def test_the_cost_of_removals_follows_from_failures_and_lost_life() -> None:
    """Three units of 1,000 h: one removed 500 h early, one 100 h early, one fails."""
    result = outcome([500.0, 900.0, None], [1000.0, 1000.0, 1000.0])
    assert result.failed == pytest.approx(1 / 3)
    assert result.wasted == pytest.approx(0.6 / 3)
    assert result.unneeded == pytest.approx(1000 / 2400)
    assert result.cost == pytest.approx(12 * 1000 / 2400)
    units = [made_up(i, good=i < 3) for i in range(4)]
    assert acted(units, WITH_FLEET, BY_RISK) == PolicyOutcome(1.0, 0.0, 0.0, 1000 * 40 / 4400)


def test_the_page_states_synthetic_units_and_holds_all_methods() -> None:
    units = [made_up(i, good=i < 3) for i in range(4)]
    text, figures = fleet_page({RECORDED: units, DRAWN: units}, 9, Quality(40, 0.975, 0.004, 0.95), "fleet")
    assert "The study is not complete: 8 of 9 runs" in text
    assert "Every unit here is synthetic" in text
    assert all(method in text for method in WAYS)
    assert "logistic (unknown to the filter)" in text
    assert "3 of 4 units have a warning in time (75.0 %)" in text
    assert "SYNTHETIC-3 fails by friction (logistic) after 1,100 h. 0.0 % of its life remain" in text
    assert set(figures) == {"scores", "tracks", "acting", "calibration"}
    assert all(picture.startswith(b"<?xml") for picture in figures.values())


def test_a_prediction_with_known_population_narrows_with_the_diagnoses_of_a_unit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(informed_module, "SAMPLE", 4000)
    plan = FleetPlan(units=1, flights=70, interval=100.0, seed=3)
    unit = drawn_unit(plan, 0)
    assert unit.failure is not None
    pool = DiagnosisPool(NEW[np.newaxis], 0.002**2 * np.eye(8)[np.newaxis])
    evidence = drawn_evidence(unit, plan, pool)
    last = len(evidence.used) - 4
    early, late = informed(evidence, plan, [0, last])
    spread = np.diff(np.quantile(early, (0.05, 0.95))), np.diff(np.quantile(late, (0.05, 0.95)))
    assert spread[1] < spread[0] / 5
    for sample, hours in ((early, 100.0), (late, 100.0 * (last + 1))):
        assert 0.01 < np.mean(hours + sample < unit.failure) < 0.99


def test_the_rate_of_a_linear_law_agrees_with_a_quadrature_over_lives(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Levels of a linear law are jointly normal given the life, whose posterior is computed by quadrature."""
    monkeypatch.setattr(informed_module, "SAMPLE", 20_000)
    plan = FleetPlan(units=1, flights=70, interval=100.0, seed=5)
    wear, population = plan.drawn_from.wear["friction"], plan.drawn_from
    component = Component("friction", wear, plan, stream(7, "test"), law="linear")
    hours, true_life = np.arange(100.0, 1001.0, 100.0), 2000.0
    evidence = straight(wear.limit / true_life, error=0.0)
    for observation in evidence.used:
        component.update(observation, 100.0)
    weight = np.exp(component.log_weight - component.log_weight.max())
    weight /= weight.sum()
    sampled = np.log(component.life)
    middle = float(weight @ sampled)
    deviation = float(np.sqrt(weight @ (sampled - middle) ** 2))

    lives = np.geomspace(800.0, 6000.0, 400)
    expected_level, together = wear.limit * hours / true_life, np.minimum.outer(hours, hours)
    log_density = [
        multivariate_normal(
            wear.limit * hours / life,
            population.new_level**2
            + together * population.drift**2 / life
            + LEAST_ERROR**2 * np.eye(hours.size),
        ).logpdf(expected_level)
        + norm.logpdf(np.log(life / wear.life) / wear.spread)
        for life in lives
    ]
    density = np.exp(np.array(log_density) - np.max(log_density))
    density /= density.sum()
    exact = float(density @ np.log(lives))
    exact_deviation = float(np.sqrt(density @ (np.log(lives) - exact) ** 2))
    # 20,000 weighted draws are as accurate as some thousand draws: to a twentieth of the deviation.
    assert middle == pytest.approx(exact, abs=0.05 * exact_deviation)
    assert deviation == pytest.approx(exact_deviation, rel=0.05)


def test_the_rates_ahead_continues_the_recorded_mission() -> None:
    """At 40 K above nominal in many intervals, components age twice as fast; nothing recorded is nominal.

    The logarithm of the rate then varies by the interval's 10 K and 0.06 of load, and without records also
    by the mission's 8 K and 0.06; the third power of the load is linear for deviations so small.
    """
    plan, hot = FleetPlan(units=1, flights=70, interval=100.0, seed=5), Stress(0.1, 288.0 + 40.0)
    pieces = tuple(StressPiece(100.0 * i, 100.0 * (i + 1), hot) for i in range(400))
    evidence = replace(straight(3e-4), stresses=pieces)
    of_interval, of_mission = np.hypot(10 / 40 * np.log(2), 0.18), np.hypot(8 / 40 * np.log(2), 0.18)
    for end, rate, spread in ((40_000.0, 2.0, of_interval), (0.0, 1.0, np.hypot(of_interval, of_mission))):
        flown = recorded_stretches(evidence, plan.drawn_from.stress, 0.0, end)
        ahead = np.log(rates_ahead(flown, plan, stream(3, "test")))
        assert np.median(ahead) == pytest.approx(np.log(rate), abs=0.02)
        assert np.std(ahead) == pytest.approx(spread, rel=0.05)


def test_a_level_reached_under_more_stress_means_a_longer_life(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two units with the same levels, one of which has aged twice as fast under its recorded stress."""
    monkeypatch.setattr(informed_module, "SAMPLE", 4000)
    plan = FleetPlan(units=1, flights=70, interval=100.0, seed=5)
    model, lives = plan.drawn_from.stress, []
    for heat in (0.0, 40.0):
        pieces = (StressPiece(0.0, 1000.0, Stress(0.1, 288.0 + heat)),)
        evidence = replace(straight(2e-4), stresses=pieces)
        component = Component("friction", plan.drawn_from.wear["friction"], plan, stream(7, "test"), "linear")
        for observation in evidence.used:
            flown = recorded_stretches(evidence, model, observation.hours - 100.0, observation.hours)
            component.update(observation, flown.aged(model))
        weight = np.exp(component.log_weight - component.log_weight.max())
        lives.append(float(weight @ component.life / weight.sum()))
    # The limit of 0.6 at 2e-4 per hour: 3,000 h.
    assert lives == pytest.approx([3000.0, 6000.0], rel=0.05)
