"""The particle filter against a hand-written Kalman filter, and its estimates from diagnoses."""

import math
import time
from dataclasses import replace

import numpy as np
import pytest

from emaphm.arrays import Array
from emaphm.prognosis.belief import Belief
from emaphm.prognosis.filter.degradation import predicted, replaced, updated
from emaphm.prognosis.filter.resampling import systematic
from emaphm.prognosis.forecast import drawn_states, paths
from emaphm.prognosis.prior import NEW, Prior
from emaphm.prognosis.requirements.first_passage import first_passage
from emaphm.prognosis.settings import CHANGING_RATE, DegradationSettings, FilterSettings, ForecastSettings

ONE_LAW = DegradationSettings(
    laws=(0, 0, 0, 0, 0, 1),
    life_scale=(1000.0, 1000.0 + 1e-9),
    change_hours=1e15,
    breaks=0.0,
    roughness=(1.0, 1.0),
    unevenness=(1e-12, 1e-12),
)
FEW = FilterSettings(particles=20)
PLAIN = FilterSettings(particles=20, outliers=0.0, jumps=0.0)


def covariance(seed: int) -> Array:
    root = 0.02 * np.random.default_rng(seed).standard_normal((8, 10))
    return np.asarray(root @ root.T + 1e-5 * np.eye(8))


def mean_rate(belief: Belief) -> Array:
    """Return the mean rate of each component at the reference stress [1/h], (8,)."""
    return np.asarray(np.sum(belief.weights * belief.rate, axis=0))


def by_hand(observed: list[tuple[float, Array, Array]]) -> tuple[Array, Array]:
    """Return mean (16,) and covariance (16, 16) of levels and rates from the Kalman filter's equations."""
    s, scale = ONE_LAW, 1000.0
    mean = np.concatenate([NEW, np.zeros(8)])
    cov = np.diag(np.concatenate([np.full(8, s.new_level**2), np.full(8, scale**-2.0)]))
    h = np.hstack([np.eye(8), np.zeros((8, 8))])
    q2, r2, before = s.noise**2 / scale, s.rate_noise**2 / scale**3, 0.0
    for hours, z, r in observed:
        t = hours - before
        f = np.block([[np.eye(8), t * np.eye(8)], [np.zeros((8, 8)), np.eye(8)]])
        block = [[q2 * t + r2 * t**3 / 3, r2 * t**2 / 2], [r2 * t**2 / 2, r2 * t]]
        mean, cov = f @ mean, f @ cov @ f.T + np.kron(block, np.eye(8))
        gain = cov @ h.T @ np.linalg.inv(h @ cov @ h.T + r)
        mean, cov = mean + gain @ (z - h @ mean), (np.eye(16) - gain @ h) @ cov
        before = hours
    return mean, cov


def test_a_filter_with_one_law_equals_a_kalman_filter() -> None:
    random = np.random.default_rng(5)
    observed = [
        (hours, NEW + hours * 2e-4 + 0.02 * random.standard_normal(8), covariance(i))
        for i, hours in enumerate([30.0, 80.0, 80.0, 200.0, 450.0, 700.0])
    ]
    belief = Belief.new(Prior(ONE_LAW), settings=PLAIN)
    for hours, z, r in observed:
        belief = updated(predicted(belief, hours), z, r, PLAIN)
    mean, cov = by_hand(observed)
    for i in range(20):
        assert np.concatenate([belief.level[i], belief.rate[i]]) == pytest.approx(mean, rel=1e-6, abs=1e-12)
        joint = np.block([[belief.levels[i], belief.mixed[i]], [belief.mixed[i].T, belief.rates[i]]])
        assert joint == pytest.approx(cov, rel=1e-5, abs=1e-13)
    assert belief.weights == pytest.approx(np.full((20, 8), 0.05), rel=1e-6)


def test_only_the_sum_of_two_levels_is_identified_where_only_their_sum_is_measured() -> None:
    belief = Belief.new(Prior(ONE_LAW), settings=FEW)
    r = np.eye(8) * 1e-4
    r[:2, :2] += 0.25 * np.array([[1, -1], [-1, 1]])
    for i in range(1, 30):
        z = NEW.copy()
        z[:2] += i * 0.01
        belief = updated(predicted(belief, 20.0 * i), z, r, FEW)
    levels = belief.levels[0]
    of_sum = levels[0, 0] + levels[1, 1] + 2 * levels[0, 1]
    of_difference = levels[0, 0] + levels[1, 1] - 2 * levels[0, 1]
    assert belief.level[0, :2].sum() == pytest.approx(0.58, abs=3 * np.sqrt(of_sum))
    assert of_difference > 50 * of_sum


def flown(level: list[float], *, seed: int = 0, step: float = 50.0, error: float = 0.01) -> Belief:
    """Return the belief after diagnoses every `step` [h] of a unit whose friction has the levels `level`."""
    random = np.random.default_rng(seed)
    settings = FilterSettings(particles=500)
    belief = Belief.new(Prior(), seed=seed, settings=settings)
    for i, friction in enumerate(level):
        z = NEW + error * random.standard_normal(8)
        z[0] += friction
        belief = updated(predicted(belief, (i + 1) * step), z, np.eye(8) * error**2, settings)
    return belief


def test_a_constant_component_and_a_wearing_component_are_distinguished() -> None:
    belief = flown([2e-4 * 50 * (i + 1) for i in range(25)])
    friction, backlash = belief.law_probabilities()[:2]
    assert friction[0] < 0.01
    assert backlash[0] > 0.2
    assert belief.mean_level[0] == pytest.approx(0.25, abs=0.015)
    assert mean_rate(belief)[0] == pytest.approx(2e-4, rel=0.2)
    assert abs(mean_rate(belief)[1]) < 3e-5


def test_a_falling_level_is_followed() -> None:
    belief = flown([0.6 - 1e-4 * 50 * i for i in range(25)])
    assert belief.mean_level[0] == pytest.approx(0.48, abs=0.02)
    assert mean_rate(belief)[0] < -2e-5


def test_a_sudden_onset_is_followed() -> None:
    # Few particles follow an onset, so rates differ between seeds: the mean over five seeds is checked.
    level = [max(0.0, 1e-3 * (50 * (i + 1) - 500)) for i in range(16)]
    beliefs = [flown(level, seed=seed) for seed in range(5)]
    assert all(belief.mean_level[0] == pytest.approx(0.3, abs=0.03) for belief in beliefs)
    assert np.mean([mean_rate(belief)[0] for belief in beliefs]) == pytest.approx(1e-3, rel=0.15)


WEAR = [2e-4 * 50 * (i + 1) for i in range(25)]
"""Levels that rise by 2e-4 per hour to 0.25; each is diagnosed with a standard error of 0.01."""


@pytest.mark.parametrize(("seed", "at"), [(0, 16), (1, 22)])
def test_a_single_outlying_diagnosis_has_no_lasting_effect(seed: int, at: int) -> None:
    """One of 25 diagnoses deviates by 30 standard errors; the estimate after it agrees with the truth."""
    frictions = WEAR.copy()
    frictions[at] += 0.3
    belief = flown(frictions, seed=seed)
    assert belief.mean_level[0] == pytest.approx(WEAR[-1], abs=0.02)
    assert mean_rate(belief)[0] == pytest.approx(2e-4, rel=0.4)
    assert belief.surprise[0] < 0.1


@pytest.mark.parametrize("seed", range(2))
def test_a_permanent_jump_is_accepted_once_later_diagnoses_confirm_it(seed: int) -> None:
    jumped = [friction + 0.3 * (i >= 21) for i, friction in enumerate(WEAR)]
    belief = flown(jumped, seed=seed)
    assert belief.mean_level[0] == pytest.approx(jumped[-1], abs=0.03)
    assert belief.mean_level[1] == pytest.approx(0.0, abs=0.02)
    # The wear continues as before the jump.
    as_before = np.abs(belief.rate[:, 0] - 2e-4) < 1e-4
    assert belief.weights[as_before, 0].sum() > 0.7


def test_after_one_outlying_diagnosis_an_outlier_and_a_jump_are_both_possible() -> None:
    belief = flown([*WEAR[:-1], WEAR[-1] + 0.3])
    far = belief.weights[belief.level[:, 0] > WEAR[-1] + 0.15, 0].sum()
    assert belief.surprise[0] > 0.99
    assert belief.surprise[1:] == pytest.approx(0.0)
    # The prior probability of a jump is a third of that of an outlier.
    assert 0.1 < far < 0.5


def test_an_expected_diagnosis_gives_the_same_update_as_without_outliers_and_jumps() -> None:
    plain = FilterSettings(outliers=0.0, jumps=0.0)
    with_them, without = (
        updated(predicted(Belief.new(Prior(), settings=s), 50.0), NEW + 0.02, np.eye(8) * 1e-4, s)
        for s in (FilterSettings(), plain)
    )
    assert np.array_equal(with_them.level, without.level)
    assert np.array_equal(with_them.weights, without.weights)


def test_a_replacement_resets_only_its_component() -> None:
    before = flown([0.02 * i for i in range(20)])
    is_replaced = np.zeros(8, bool)
    is_replaced[0] = True
    after = replaced(before, is_replaced)
    assert after.level[:, 0] == pytest.approx(0.0)
    assert after.level[:, 1:] == pytest.approx(before.level[:, 1:])
    assert after.levels[:, 1:, 1:] == pytest.approx(before.levels[:, 1:, 1:])
    assert after.levels[:, 0, 1:] == pytest.approx(0.0)
    assert after.mixed[:, 0, :] == pytest.approx(0.0)
    assert after.mixed[:, :, 0] == pytest.approx(0.0)
    assert after.new_at[0] == 1000.0
    # Between diagnoses, the old component's age is correlated with its level; the new component's age is 0.
    later = replaced(predicted(before, 1040.0), is_replaced)
    assert np.any(later.age_and_level[:, 1:])
    assert not np.any(later.age_and_level[:, 0])
    assert not np.any(later.aged[:, 0])
    assert after.law_probabilities()[0, :-1] == pytest.approx(before.prior.settings.laws, abs=0.06)


def test_a_replacement_ends_the_surprise_of_its_component() -> None:
    before = replace(flown([0.0] * 3), surprise=np.full(8, 0.9))
    after = replaced(before, np.arange(8) == 1)
    assert after.surprise.tolist() == [0.9, 0.0, *[0.9] * 6]


def test_equal_seeds_give_identical_beliefs_and_other_seeds_give_others() -> None:
    first, repeated, other_seed = (flown([0.01 * i for i in range(8)], seed=seed) for seed in (3, 3, 4))
    assert np.array_equal(first.level, repeated.level)
    assert np.array_equal(first.weights, repeated.weights)
    assert not np.array_equal(first.level, other_seed.level)


def test_systematic_resampling_copies_particles_in_proportion_to_their_weights() -> None:
    rows = systematic(np.array([0.5, 0.0, 0.25, 0.25]), 8, np.random.default_rng(0))
    assert np.bincount(rows, minlength=4).tolist() == [4, 0, 2, 2]


def test_an_update_takes_milliseconds() -> None:
    belief, took = Belief.new(Prior()), []
    for i in range(1, 12):
        start = time.process_time()
        belief = updated(predicted(belief, 50.0 * i), NEW, covariance(i))
        took.append(time.process_time() - start)
    # The budget is 10 ms; the factor of 4 allows for a shared machine.
    assert np.median(took) < 0.04


def test_particles_have_the_number_of_the_only_possible_law() -> None:
    assert set(np.unique(Belief.new(Prior(ONE_LAW), settings=FEW).law)) == {CHANGING_RATE}


def test_uneven_ageing_increases_the_level_variance_according_to_the_law() -> None:
    """Linear law, rate v ~ N(0, 1/T²), ageing variance u² T h: the level's variance grows by E[v²] u² T h."""
    u, scale, hours = 0.1, 1000.0, 300.0
    settings = DegradationSettings(
        laws=(0, 1, 0, 0, 0, 0),
        life_scale=(scale, scale + 1e-9),
        noise=0.0,
        unevenness=(u, u + 1e-12),
        change_hours=1e15,
        breaks=0.0,
    )
    after = predicted(Belief.new(Prior(settings), settings=FEW), hours)
    expected = settings.new_level**2 + (hours / scale) ** 2 + u**2 * scale * hours / scale**2
    assert np.einsum("nii->ni", after.levels) == pytest.approx(np.full((20, 8), expected), rel=1e-6)
    assert np.einsum("nii->ni", after.rates) == pytest.approx(np.full((20, 8), scale**-2.0), rel=1e-6)


def test_breaks_increase_the_second_moment_of_a_rate() -> None:
    """Linear law, rate v ~ N(0, 1/T²): E[v²] grows by P(break) (E[f²] - 1), ln f ~ N(0, 0.3²)."""
    scale, hours = 1000.0, 500.0
    settings = DegradationSettings(
        laws=(0, 1, 0, 0, 0, 0),
        life_scale=(scale, scale + 1e-9),
        noise=0.0,
        unevenness=(1e-12, 1e-12),
        change_hours=1e15,
        breaks=1.0,
        break_factor=0.3,
    )
    many = FilterSettings(particles=2000)
    after = predicted(Belief.new(Prior(settings), settings=many), hours)
    variances = np.einsum("nii->ni", after.rates) * scale**2
    breaks = -np.expm1(-hours / scale)
    # 14,000 possible breaks are independent: the eccentricity's two coordinates break together.
    assert np.mean(np.abs(variances - 1) > 1e-9) == pytest.approx(breaks, abs=0.02)
    assert variances.mean() == pytest.approx(1 + breaks * math.expm1(2 * 0.3**2), rel=0.02)
    assert after.levels[0, 0, 0] == pytest.approx(
        settings.new_level**2 + after.rates[0, 0, 0] * hours**2, rel=1e-6
    )


def test_both_coordinates_of_an_eccentricity_have_the_same_law_and_weights() -> None:
    belief = Belief.new(Prior(), settings=FilterSettings(particles=300))
    for i in range(1, 15):
        z = NEW.copy()
        z[5:7] += 0.02 * i * np.array([0.6, -0.8])
        belief = updated(predicted(belief, 50.0 * i), z, np.eye(8) * 1e-4)
    for values in (belief.law, belief.life_scale, belief.aged, belief.log_weights, belief.unevenness):
        assert np.array_equal(values[:, 5], values[:, 6])
    assert mean_rate(belief)[5:7] == pytest.approx([0.02 * 0.6 / 50, -0.02 * 0.8 / 50], rel=0.15)


def test_a_surprise_in_one_coordinate_of_an_eccentricity_counts_for_both() -> None:
    belief = flown([0.0] * 5)
    covariance = np.eye(8) * 1e-4
    covariance[6, 6] = 0.31**2  # a coordinate with so large an error cannot surprise by itself
    z = NEW.copy()
    z[5] += 0.5
    after = updated(predicted(belief, belief.hours + 50.0), z, covariance)
    assert after.surprise[5] == after.surprise[6]
    assert np.array_equal(after.law[:, 5], after.law[:, 6])
    assert np.array_equal(after.log_weights[:, 5], after.log_weights[:, 6])


@pytest.mark.parametrize("seed", [109, 111])
def test_a_finished_crack_of_an_eccentricity_has_one_weight(seed: int) -> None:
    """Each coordinate has another error; cracks of short lives have ended before the last diagnosis."""
    prior = Prior(DegradationSettings(laws=(0.2, 0, 0, 0, 0, 0, 0.8), life_scale=(200.0, 3000.0)))
    random = np.random.default_rng(seed)
    belief = Belief.new(prior, seed=seed, settings=FilterSettings(particles=300))
    covariance = np.diag([1e-4, 1e-4, 1e-4, 1e-4, 1e-4, 0.01, 0.09, 1e-4])
    finished = 0
    for i in range(1, 8):
        z = NEW + 0.01 * random.standard_normal(8)
        z[5] += 0.7
        belief = predicted(belief, 100.0 * i)
        finished += int(np.sum(belief.life_scale[:, 5] <= belief.aged[:, 5]))
        belief = updated(belief, z, covariance)
        assert np.array_equal(belief.log_weights[:, 5], belief.log_weights[:, 6])
        assert np.array_equal(belief.law[:, 5], belief.law[:, 6])
    assert finished > 10


@pytest.mark.parametrize(("first", "last"), [(600.0, 600.0), (300.0, 900.0)])
def test_the_posterior_of_a_working_unit_excludes_cracks_that_would_be_infinite_by_now(
    first: float, last: float
) -> None:
    """The reference is a sample of the prior's cracks in closed form, weighted by the diagnoses' likelihood.

    Without noise, x = x_0 + v T/q ((T/(T-t))^q - 1), at the limit when
    t = T - T (1 + q (limit - x_0) / (v T))^(-1/q).
    """
    settings = DegradationSettings(
        laws=(0, 0, 0, 0, 0, 0, 1),
        noise=1e-6,
        unevenness=(1e-6, 2e-6),
        breaks=0.0,
        change_hours=1e12,
        new_level=0.03,
    )
    error, limit, diagnosed = 0.02, 0.6, {first: 0.1 if first < last else 0.15, last: 0.15}
    random = np.random.default_rng(1)
    drawn = Prior(settings).draw(400_000, random, 1)
    scale, q = drawn.life_scale[:, 0], drawn.shape[:, 0]
    rate = drawn.rate_deviation[:, 0] * random.standard_normal(scale.size)
    start = settings.new_level * random.standard_normal(scale.size)
    survives = scale > last
    scale, q, rate, start = (values[survives] for values in (scale, q, rate, start))
    misfit = sum(
        (x - start - rate * scale / q * ((scale / (scale - t)) ** q - 1)) ** 2 for t, x in diagnosed.items()
    )
    weights = np.exp(-0.5 * misfit / error**2)
    positive_rate = np.maximum(rate, 1e-12)
    ends = scale - scale * (1 + q * np.maximum(limit - start, 0.0) / (positive_rate * scale)) ** (-1 / q)
    ends = np.where(rate > 0, ends, np.inf) - last

    # No resampling: its kernel would smooth the information of two diagnoses.
    plain = FilterSettings(particles=20_000, outliers=0.0, jumps=0.0, trust=1.0, effective_share=0.0)
    belief = Belief.new(Prior(settings), settings=plain, components=1)
    for hours, level in diagnosed.items():
        belief = updated(predicted(belief, hours), np.array([level]), np.array([[error**2]]), plain)
    ahead = ForecastSettings(paths=4000)
    forecast = paths(drawn_states(belief, ahead.paths), Prior(settings), seed=1, settings=ahead)
    lives = first_passage(forecast.hours, limit - forecast.level[:, :, 0], forecast.noise[:, :, 0], random)
    for hours in (20.0, 100.0, 300.0, 1000.0, 3000.0):
        expected = np.sum(weights * (ends <= hours)) / weights.sum()
        assert np.mean(lives <= hours) == pytest.approx(expected, abs=0.03), hours
