"""Forecasts against closed forms: first passages of a Wiener process, truncated normals and laws."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.stats import invgauss, kstest, norm, truncnorm

from emaphm.arrays import Array
from emaphm.prognosis.belief import Belief
from emaphm.prognosis.evidence import Evidence, Observation
from emaphm.prognosis.filter.following import follow
from emaphm.prognosis.forecast import UnitDraws, drawn_states, paths
from emaphm.prognosis.laws import LARGEST_EXPONENT, noises, transition
from emaphm.prognosis.prior import NEW, Prior
from emaphm.prognosis.requirements.first_passage import first_passage
from emaphm.prognosis.settings import (
    CONSTANT,
    CRACK_GROWTH,
    DEGRADATION,
    EXPONENTIAL,
    LINEAR,
    POWER_LAW,
    DegradationSettings,
    FilterSettings,
    ForecastSettings,
)

NOISY = DegradationSettings(noise=0.3, rate_noise=0.0, change_hours=1e12, breaks=0.0)


def states(law: int, count: int, *, level: float, rate: float, life_scale: float = 1000.0) -> UnitDraws:
    shape = (count, 8)
    laws = np.full(shape, CONSTANT, np.int8)
    laws[:, 0] = law
    levels, rates = np.tile(NEW, (count, 1)), np.zeros(shape)
    levels[:, 0], rates[:, 0] = level, rate
    return UnitDraws(
        np.zeros(shape),
        np.zeros((*shape, 3)),
        laws,
        np.full(shape, life_scale),
        np.full(shape, 0.5),
        np.ones(shape),
        np.zeros(shape),
        levels,
        rates,
    )


@pytest.mark.parametrize(("start", "rate"), [(0.4, 1e-3), (0.5, 5e-4)])
def test_first_passages_of_a_wiener_process_are_inverse_gaussian(start: float, rate: float) -> None:
    """Distance a to the limit, drift v, variance q² per hour: mean a / v and shape a² / q²."""
    settings = ForecastSettings(longest_hours=40_000.0, steps=40)
    forecast = paths(states(LINEAR, 4000, level=start, rate=rate), Prior(NOISY), seed=1, settings=settings)
    limit = 0.8
    passed = first_passage(
        forecast.hours, limit - forecast.level[:, :, 0], forecast.noise[:, :, 0], np.random.default_rng(2)
    )
    mean, shape = (limit - start) / rate, (limit - start) ** 2 / (NOISY.noise**2 / 1000)
    exact = invgauss(mean / shape, scale=shape)
    observed = np.minimum(passed, 40_000.0)
    assert np.mean(passed < 40_000) == pytest.approx(exact.cdf(40_000), abs=1e-3)
    assert kstest(observed, exact.cdf).pvalue > 0.01


def test_first_passages_between_coarse_times_are_exact() -> None:
    """With one step over all hours, the distribution is still inverse Gaussian up to the step's end."""
    random = np.random.default_rng(3)
    n, hours, q, drift, start = 20_000, 500.0, 0.02, 1e-3, 0.4
    end = start - drift * hours - q * np.sqrt(hours) * random.standard_normal(n)
    margin = np.stack([np.full(n, start), end])
    passed = first_passage(np.array([0.0, hours]), margin, np.full((1, n), q), random)
    shape = start**2 / q**2
    exact = invgauss(start / drift / shape, scale=shape)
    for t in (100.0, 200.0, 300.0, 400.0, 500.0):
        share = float(np.mean(passed <= t))
        assert share == pytest.approx(exact.cdf(t), abs=4 * np.sqrt(0.25 / n)), t


def test_hours_between_two_limits_are_those_of_a_process_started_at_the_first_limit() -> None:
    """A Wiener process has no memory: the hours are inverse Gaussian, for the distance between the limits."""
    settings = ForecastSettings(longest_hours=60_000.0, steps=30)
    forecast = paths(states(LINEAR, 4000, level=0.2, rate=1e-3), Prior(NOISY), seed=1, settings=settings)
    level, noise, random = forecast.level[:, :, 0], forecast.noise[:, :, 0], np.random.default_rng(4)
    tight = first_passage(forecast.hours, 0.4 - level, noise, random)
    wide = first_passage(forecast.hours, 0.5 - level, noise, random, tight, 0.1)
    mean, shape = 0.1 / 1e-3, 0.1**2 / (NOISY.noise**2 / 1000)
    assert kstest(wide - tight, invgauss(mean / shape, scale=shape).cdf).pvalue > 0.01
    again = first_passage(forecast.hours, 0.4 - level, noise, random, tight, 0.0)
    assert np.array_equal(again, tight)


def test_a_margin_without_noise_passes_zero_at_its_linear_interpolation() -> None:
    margin = np.array([[1.0, 1.0, -0.1], [0.5, 0.9, 1.0], [-0.5, 0.8, 1.0]])
    passed = first_passage(np.array([0.0, 10.0, 20.0]), margin, np.zeros((2, 3)), np.random.default_rng(0))
    assert passed == pytest.approx([15.0, np.inf, 0.0], rel=1e-3)


def test_levels_are_drawn_from_truncated_normal_distributions() -> None:
    """A normal level about 0 with bounds 0 and 1 becomes truncated normal; other levels stay normal.

    A friction may be below that of a new unit, so it is not truncated at 0.
    """
    belief = Belief.new(Prior(), settings=FilterSettings(particles=500))
    drawn = drawn_states(belief, 4000)
    deviation = belief.prior.settings.new_level
    assert kstest(drawn.level[:, 0], norm(0.0, deviation).cdf).pvalue > 0.01
    assert kstest(drawn.level[:, 1], truncnorm(0, 1 / deviation, scale=deviation).cdf).pvalue > 0.01
    assert kstest(drawn.level[:, 7], norm(0.5, deviation).cdf).pvalue > 0.01
    assert np.all(np.hypot(drawn.level[:, 5], drawn.level[:, 6]) <= 1)


def test_the_error_shared_by_all_diagnoses_does_not_average_out() -> None:
    covariance, shared = 1e-4 * np.eye(8), np.zeros((8, 8))
    shared[:2, :2] = 0.05**2 * np.array([[1.0, -0.6], [-0.6, 1.0]])
    level = NEW + 0.4 * (np.arange(8) < 2)
    seen = np.ones(8, bool)
    hours = 40.0 * np.arange(1, 16)

    def drawn(common: Array | float) -> Array:
        observations = tuple(
            Observation(float(at), level, covariance + common, seen, shared=common) for at in hours
        )
        belief = follow(Evidence("A", "1", 600.0, observations), Prior()).belief
        return np.cov(drawn_states(belief, 4000).level[:, :2], rowvar=False)

    np.testing.assert_allclose(drawn(shared), drawn(0.0) + shared[:2, :2], atol=0.1 * 0.05**2)


def test_drawn_levels_keep_a_well_known_sum_within_their_bounds() -> None:
    """The sum of two levels is known, their difference is not; the drawn levels have that sum."""
    belief = Belief.new(Prior(), settings=FilterSettings(particles=200))
    covariance = np.tile(np.eye(8) * 1e-6, (200, 1, 1))
    covariance[:, :2, :2] += 0.04 * np.array([[1, -1], [-1, 1]])
    level = np.tile(NEW, (200, 1))
    level[:, :2] = 0.1
    object.__setattr__(belief, "levels", covariance)
    object.__setattr__(belief, "level", level)
    drawn = drawn_states(belief, 1000).level
    assert drawn[:, :2].sum(axis=1) == pytest.approx(0.2, abs=6e-3)  # four standard deviations of the sum
    assert drawn[:, 0].std() > 0.04


@pytest.mark.parametrize("law", [LINEAR, EXPONENTIAL, POWER_LAW, CRACK_GROWTH])
def test_laws_do_not_depend_on_the_division_of_time_into_steps(law: int) -> None:
    numbers = np.array([law], np.int8)
    scale, shape = np.array([800.0]), np.array([0.7])
    settings = DegradationSettings()
    reach, growth = transition(numbers, scale, shape, np.array([50.0]), 300.0, settings)
    level, rate = 0.0, 1.0
    for i in range(30):
        d, g = transition(numbers, scale, shape, np.array([50.0 + 10 * i]), 10.0, settings)
        level, rate = level + d[0] * rate, g[0] * rate
    assert (level, rate) == pytest.approx((reach[0], growth[0]), rel=1e-9)


def test_the_exponential_law_and_the_power_law_agree_with_their_closed_forms() -> None:
    settings, scale, t = DegradationSettings(), np.array([800.0]), 240.0
    reach, growth = transition(
        np.array([EXPONENTIAL], np.int8), scale, np.array([0.5]), np.zeros(1), t, settings
    )
    assert reach[0] == pytest.approx(400 * (np.exp(t / 400) - 1))
    assert growth[0] == pytest.approx(np.exp(t / 400))
    reach, growth = transition(
        np.array([POWER_LAW], np.int8), scale, np.array([2.0]), np.array([60.0]), t, settings
    )
    # c (300² - 60²), with the initial rate 2 c 60.
    assert reach[0] == pytest.approx((300**2 - 60**2) / 120)
    assert growth[0] == pytest.approx(5.0)


def test_the_crack_law_agrees_with_the_integrated_differential_equation() -> None:
    """The reference is `solve_ivp` of dx/dt = c x^m, whose singularity is at x_0^(1-m) / (c (m - 1))."""
    m, c, first = 1.5, 0.01, 0.04
    end = first ** (1 - m) / (c * (m - 1))
    t = 0.9 * end
    length = solve_ivp(lambda _, x: c * x**m, (0, t), [first], rtol=1e-11, atol=1e-14).y[0, -1]
    reach, growth = transition(
        np.array([CRACK_GROWTH], np.int8),
        np.array([end]),
        np.array([1 / (m - 1)]),
        np.zeros(1),
        t,
        DEGRADATION,
    )
    rate = c * first**m
    assert first + reach[0] * rate == pytest.approx(length, rel=1e-8)
    assert growth[0] * rate == pytest.approx(c * length**m, rel=1e-8)


@given(age=st.floats(0, 1e5), hours=st.floats(1e-3, 1e5), q=st.floats(*DEGRADATION.crack))
def test_a_crack_beyond_its_singularity_is_large_and_finite(age: float, hours: float, q: float) -> None:
    reach, growth = transition(
        np.array([CRACK_GROWTH], np.int8),
        np.array([800.0]),
        np.array([q]),
        np.array([age]),
        hours,
        DEGRADATION,
    )
    assert 0 < reach[0] < 1e6
    assert 1 <= growth[0] <= 1.001 * np.exp(LARGEST_EXPONENT)
    # A life of centuries under a stress far above the reference does not overflow.
    long = np.array([CRACK_GROWTH], np.int8), np.array([1e12]), np.array([q]), np.array([age]), 2e12
    assert np.all(np.isfinite(transition(*long, DEGRADATION)))
    if hours >= max(800 - age, 0.8):  # the law's last thousandth takes 0.8 h, also beyond the singularity
        assert growth[0] == pytest.approx(np.exp(LARGEST_EXPONENT))


def test_process_noise_of_many_steps_equals_that_of_one_step() -> None:
    """The rate is a Wiener process: the level's variance is q² t + r² t³ / 3 for any division into steps."""
    law, scale, s = np.array([LINEAR], np.int8), np.array([500.0]), DegradationSettings()
    expected = [part[0] for part in noises(law, scale, np.ones(1), 200.0, s)]
    ll, lr, rr = 0.0, 0.0, 0.0
    for _ in range(20):
        a, b, c = (part[0] for part in noises(law, scale, np.ones(1), 10.0, s))
        ll, lr, rr = ll + 20 * lr + 100 * rr + a, lr + 10 * rr + b, rr + c
    assert (ll, lr, rr) == pytest.approx(expected, rel=1e-9)


def test_uneven_ageing_scatters_a_level_in_proportion_to_its_rate() -> None:
    """Ageing has the variance u² T h in h hours; at the rate v, the level has the variance v² u² T h."""
    even = states(LINEAR, 8000, level=0.0, rate=1e-4)
    state = replace(even, unevenness=np.full(even.law.shape, 0.1))
    settings = DegradationSettings(noise=0.0, rate_noise=0.0, change_hours=1e12, breaks=0.0)
    forecast = paths(
        state, Prior(settings), seed=3, settings=ForecastSettings(longest_hours=4000.0, steps=40)
    )
    last = forecast.level[-1, :, 0]
    assert last.mean() == pytest.approx(1e-4 * forecast.hours[-1], rel=0.01)
    # The standard deviation of 8,000 values has a standard error of 0.8 %; five of these are allowed.
    assert last.std() == pytest.approx(1e-4 * 0.1 * math.sqrt(1000.0 * forecast.hours[-1]), rel=0.04)


def test_breaks_of_a_rate_occur_as_a_poisson_process() -> None:
    """P(no break in h hours) = exp(-b h/T); an increase and a decrease of the rate are equally probable."""
    settings = DegradationSettings(
        noise=0.0, rate_noise=0.0, change_hours=1e12, breaks=2.0, break_factor=0.05
    )
    state = states(LINEAR, 8000, level=0.0, rate=1e-4)
    forecast = paths(
        state, Prior(settings), seed=4, settings=ForecastSettings(longest_hours=1000.0, steps=30)
    )
    hours, last = forecast.hours[-1], forecast.level[-1, :, 0]
    deviation = last - 1e-4 * hours
    unbroken = np.abs(deviation) < 1e-9
    expected = math.exp(-2.0 * hours / 1000.0)
    assert unbroken.mean() == pytest.approx(expected, abs=4 * math.sqrt(expected / 8000))
    assert np.mean(deviation[~unbroken] > 0) == pytest.approx(0.5, abs=0.025)


def test_a_constant_component_has_no_breaks() -> None:
    settings = DegradationSettings(noise=0.0, rate_noise=0.0, change_hours=1e12, breaks=100.0)
    forecast = paths(states(CONSTANT, 100, level=0.3, rate=0.0), Prior(settings), seed=5)
    assert forecast.level[:, :, 0] == pytest.approx(0.3)
