"""Forecasts against closed forms: first passages of a Wiener process, truncated normals, laws."""

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
def test_a_wiener_process_fails_by_the_inverse_gaussian_distribution(start: float, rate: float) -> None:
    """Level a away, drift v, variance q² an hour: inverse Gaussian of mean a / v and shape a² / q²."""
    settings = ForecastSettings(longest_hours=40_000.0, steps=40)
    made = paths(states(LINEAR, 4000, level=start, rate=rate), Prior(NOISY), seed=1, settings=settings)
    limit = 0.8
    passed = first_passage(
        made.hours, limit - made.level[:, :, 0], made.noise[:, :, 0], np.random.default_rng(2)
    )
    mean, shape = (limit - start) / rate, (limit - start) ** 2 / (NOISY.noise**2 / 1000)
    exact = invgauss(mean / shape, scale=shape)
    seen = np.minimum(passed, 40_000.0)
    assert np.mean(passed < 40_000) == pytest.approx(exact.cdf(40_000), abs=1e-3)
    assert kstest(seen, exact.cdf).pvalue > 0.01


def test_a_bridge_between_coarse_times_is_exact() -> None:
    """One step over all hours: the distribution is still the inverse Gaussian one up to its end."""
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


def test_from_one_limit_to_a_wider_one_takes_the_hours_of_a_path_that_begins_there() -> None:
    """A Wiener process begins anew where it is: these hours are inverse Gaussian as well, of the distance."""
    settings = ForecastSettings(longest_hours=60_000.0, steps=30)
    made = paths(states(LINEAR, 4000, level=0.2, rate=1e-3), Prior(NOISY), seed=1, settings=settings)
    level, noise, random = made.level[:, :, 0], made.noise[:, :, 0], np.random.default_rng(4)
    tight = first_passage(made.hours, 0.4 - level, noise, random)
    wide = first_passage(made.hours, 0.5 - level, noise, random, tight, 0.1)
    mean, shape = 0.1 / 1e-3, 0.1**2 / (NOISY.noise**2 / 1000)
    assert kstest(wide - tight, invgauss(mean / shape, scale=shape).cdf).pvalue > 0.01
    again = first_passage(made.hours, 0.4 - level, noise, random, tight, 0.0)
    assert np.array_equal(again, tight)


def test_without_noise_a_margin_passes_where_the_line_does() -> None:
    margin = np.array([[1.0, 1.0, -0.1], [0.5, 0.9, 1.0], [-0.5, 0.8, 1.0]])
    passed = first_passage(np.array([0.0, 10.0, 20.0]), margin, np.zeros((2, 3)), np.random.default_rng(0))
    assert passed == pytest.approx([15.0, np.inf, 0.0], rel=1e-3)


def test_levels_are_drawn_within_their_bounds() -> None:
    """A normal level about 0 with bounds 0 and 1 becomes a truncated normal one; the others keep theirs.

    A friction may be below that of a new unit.
    """
    belief = Belief.new(Prior(), settings=FilterSettings(particles=500))
    drawn = drawn_states(belief, 4000)
    deviation = belief.prior.settings.new_level
    assert kstest(drawn.level[:, 0], norm(0.0, deviation).cdf).pvalue > 0.01
    assert kstest(drawn.level[:, 1], truncnorm(0, 1 / deviation, scale=deviation).cdf).pvalue > 0.01
    assert kstest(drawn.level[:, 7], norm(0.5, deviation).cdf).pvalue > 0.01
    assert np.all(np.hypot(drawn.level[:, 5], drawn.level[:, 6]) <= 1)


def test_no_number_of_diagnoses_makes_up_for_what_they_share() -> None:
    covariance, shared = 1e-4 * np.eye(8), np.zeros((8, 8))
    shared[:2, :2] = 0.05**2 * np.array([[1.0, -0.6], [-0.6, 1.0]])
    level = NEW + 0.4 * (np.arange(8) < 2)
    seen = np.ones(8, bool)
    hours = 40.0 * np.arange(1, 16)

    def drawn(common: Array | float) -> Array:
        observations = tuple(
            Observation(float(one), level, covariance + common, seen, shared=common) for one in hours
        )
        belief = follow(Evidence("A", "1", 600.0, observations), Prior()).belief
        return np.cov(drawn_states(belief, 4000).level[:, :2], rowvar=False)

    np.testing.assert_allclose(drawn(shared), drawn(0.0) + shared[:2, :2], atol=0.1 * 0.05**2)


def test_what_is_known_only_in_sum_stays_so_within_bounds() -> None:
    """Two levels whose sum is known and whose difference is not: the drawn ones have that sum."""
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
def test_laws_do_not_depend_on_how_time_is_cut(law: int) -> None:
    numbers = np.array([law], np.int8)
    scale, shape = np.array([800.0]), np.array([0.7])
    settings = DegradationSettings()
    reach, growth = transition(numbers, scale, shape, np.array([50.0]), 300.0, settings)
    level, rate = 0.0, 1.0
    for i in range(30):
        d, g = transition(numbers, scale, shape, np.array([50.0 + 10 * i]), 10.0, settings)
        level, rate = level + d[0] * rate, g[0] * rate
    assert (level, rate) == pytest.approx((reach[0], growth[0]), rel=1e-9)


def test_laws_are_the_functions_that_name_them() -> None:
    settings, scale, t = DegradationSettings(), np.array([800.0]), 240.0
    reach, growth = transition(
        np.array([EXPONENTIAL], np.int8), scale, np.array([0.5]), np.zeros(1), t, settings
    )
    assert reach[0] == pytest.approx(400 * (np.exp(t / 400) - 1))
    assert growth[0] == pytest.approx(np.exp(t / 400))
    reach, growth = transition(
        np.array([POWER_LAW], np.int8), scale, np.array([2.0]), np.array([60.0]), t, settings
    )
    # c (300² - 60²) with the rate 2 c 60 at first.
    assert reach[0] == pytest.approx((300**2 - 60**2) / 120)
    assert growth[0] == pytest.approx(5.0)


def test_a_crack_grows_by_a_power_of_its_length() -> None:
    """Against `solve_ivp` of dx/dt = c x^m, which is infinite at x_0^(1-m) / (c (m - 1))."""
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
def test_past_its_end_a_crack_is_large_and_finite(age: float, hours: float, q: float) -> None:
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
    if hours >= max(800 - age, 0.8):  # its last thousandth takes as long, past the end too
        assert growth[0] == pytest.approx(np.exp(LARGEST_EXPONENT))


def test_process_noise_adds_up() -> None:
    """The level's variance by an integrated Wiener process of the rate: q² t + r² t³ / 3, in any cuts."""
    law, scale, s = np.array([LINEAR], np.int8), np.array([500.0]), DegradationSettings()
    whole = [part[0] for part in noises(law, scale, np.ones(1), 200.0, s)]
    ll, lr, rr = 0.0, 0.0, 0.0
    for _ in range(20):
        a, b, c = (part[0] for part in noises(law, scale, np.ones(1), 10.0, s))
        ll, lr, rr = ll + 20 * lr + 100 * rr + a, lr + 10 * rr + b, rr + c
    assert (ll, lr, rr) == pytest.approx(whole, rel=1e-9)


def test_uneven_ageing_scatters_a_level_by_its_rate() -> None:
    """Ageing has the variance u² T h in h hours; at the rate v, the level has v² times that."""
    even = states(LINEAR, 8000, level=0.0, rate=1e-4)
    state = replace(even, unevenness=np.full(even.law.shape, 0.1))
    settings = DegradationSettings(noise=0.0, rate_noise=0.0, change_hours=1e12, breaks=0.0)
    made = paths(state, Prior(settings), seed=3, settings=ForecastSettings(longest_hours=4000.0, steps=40))
    last = made.level[-1, :, 0]
    assert last.mean() == pytest.approx(1e-4 * made.hours[-1], rel=0.01)
    # The standard deviation of 8,000 values is right to 0.8 %, and five of these are allowed.
    assert last.std() == pytest.approx(1e-4 * 0.1 * math.sqrt(1000.0 * made.hours[-1]), rel=0.04)


def test_a_rate_that_breaks_leaves_the_line_at_the_hours_of_a_poisson_process() -> None:
    """No break in h hours has the probability exp(-b h/T); a break is faster or slower alike."""
    settings = DegradationSettings(
        noise=0.0, rate_noise=0.0, change_hours=1e12, breaks=2.0, break_factor=0.05
    )
    state = states(LINEAR, 8000, level=0.0, rate=1e-4)
    made = paths(state, Prior(settings), seed=4, settings=ForecastSettings(longest_hours=1000.0, steps=30))
    hours, last = made.hours[-1], made.level[-1, :, 0]
    apart = last - 1e-4 * hours
    unbroken = np.abs(apart) < 1e-9
    expected = math.exp(-2.0 * hours / 1000.0)
    assert unbroken.mean() == pytest.approx(expected, abs=4 * math.sqrt(expected / 8000))
    assert np.mean(apart[~unbroken] > 0) == pytest.approx(0.5, abs=0.025)


def test_what_does_not_move_does_not_break() -> None:
    settings = DegradationSettings(noise=0.0, rate_noise=0.0, change_hours=1e12, breaks=100.0)
    made = paths(states(CONSTANT, 100, level=0.3, rate=0.0), Prior(settings), seed=5)
    assert made.level[:, :, 0] == pytest.approx(0.3)
