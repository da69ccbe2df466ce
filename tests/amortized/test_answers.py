"""Drawing, layers, the mixture, the projection and the judgement, each against something else."""

import numpy as np
import pytest
from scipy.stats import binom, chi2, kstest

from amortized.toys import CHIRP, short_setup
from emaphm.actuator import Actuator
from emaphm.actuator.faults import lower_bounds
from emaphm.actuator.lumped_parameters import lumped_parameters, with_lumped_parameters
from emaphm.actuator.unit.tolerances import Tolerances
from emaphm.amortized.drawing import PRIOR, draw
from emaphm.amortized.judging import judged, temperature_of
from emaphm.amortized.networks.layers import FEW, Dense
from emaphm.amortized.networks.mixture import Mixture
from emaphm.amortized.networks.projection import Projection
from emaphm.amortized.simulating import in_blocks, noise_rms, simulated
from emaphm.arrays import Array
from emaphm.simulation import AVERAGED

SETUP = short_setup()
SPACE = SETUP.space
COUNT = 250
"""Answers that are judged."""

MIDDLE = np.array([0.4, 0.5, 0.3, 0.5, 0.4, 0.3, 0.2, 0.5, 0.02, 0.03])


def test_draws_lie_within_the_bounds_and_reach_all_kinds() -> None:
    points = draw(SPACE, 4000, np.random.default_rng(0))
    np.testing.assert_allclose(SPACE.project(points), points, atol=1e-12)
    faults = SPACE.faults(points)
    low = float(lower_bounds(Actuator.thesis())[0])
    assert faults[:, 0].min() < 0.9 * low
    assert np.mean(np.all(faults[:, 2:5] >= PRIOR.heavy_short[0], axis=1)) > 0.1
    assert np.mean(np.all(faults[:, 1:5] < 0.2, axis=1)) > 0.05
    deviations = points[:, 8:].std(axis=0)
    np.testing.assert_allclose(deviations, SPACE.nuisances.priors, rtol=0.05)


def test_units_are_drawn_within_their_tolerances() -> None:
    tolerances = Tolerances(inertia=0.2, viscous=1.0)
    unit = Actuator.thesis().model_copy(update={"tolerances": tolerances})
    setup = short_setup(unit)
    points = draw(setup.space, 4000, np.random.default_rng(0))
    values = setup.space.nuisance_values(points)
    for name, factor in (("inertia", 1.2), ("viscous", 2.0)):
        inside = np.mean(np.abs(values[f"baseline {name}"]) < np.log(factor))
        assert inside == pytest.approx(0.9545, abs=4 * 0.0033)  # two standard deviations; of 4000 draws
    # What was drawn is what is simulated: a unit of 1.2 times the inertia, described as such or drawn.
    heavier = np.zeros((1, setup.space.dimensions))
    heavier[:, 7] = 0.5
    heavier[:, setup.space.coordinates.index("baseline inertia")] = np.log(1.2)
    inertia = 1.2 * lumped_parameters(unit, ("inertia",))["inertia"]
    described = short_setup(with_lumped_parameters(Actuator.thesis(), {"inertia": inertia}))
    step = AVERAGED.step_for(unit)
    drawn = simulated(setup, setup.inputs(CHIRP, step), AVERAGED, heavier)
    given = simulated(
        described, described.inputs(CHIRP, step), AVERAGED, heavier[:, : described.space.dimensions]
    )
    np.testing.assert_allclose(drawn, given, rtol=1e-5, atol=1e-6)


def test_directions_of_eccentricity_are_even() -> None:
    faults = SPACE.faults(draw(SPACE, 4000, np.random.default_rng(1)))
    some = faults[faults[:, 5] > 1e-6, 6]
    assert kstest(some, "uniform").pvalue > 1e-3


def mixture(rng: np.random.Generator, components: int = 3, d: int = 10) -> Mixture:
    factors = np.tril(rng.normal(size=(components, d, d))) * 0.05 + 0.05 * np.eye(d)
    means = MIDDLE[:d] + 0.1 * rng.normal(size=(components, d))
    return Mixture(np.full(components, 1 / components), means, factors)


def test_moments_are_those_of_its_samples() -> None:
    one = mixture(np.random.default_rng(2))
    samples = one.sample(200_000, np.random.default_rng(3))
    np.testing.assert_allclose(samples.mean(axis=0), one.mean, atol=4 * 0.3 / 200_000**0.5)
    np.testing.assert_allclose(np.cov(samples.T), one.covariance, atol=2e-3)


def test_a_search_begins_where_components_differ() -> None:
    factors = np.tile(0.05 * np.eye(2), (3, 1, 1))
    factors[2] *= 10.0
    means = np.array([[0.2, 0.5], [0.8, 0.5], [0.8, 0.5]])
    weights = np.array([0.5, 0.4, 0.1])
    starts = Mixture(weights, means, factors).starts(0.05, 3.0)
    np.testing.assert_allclose(starts, [[0.5, 0.5], [0.2, 0.5], [0.8, 0.5]])
    alike = Mixture(weights, np.tile(means[0], (3, 1)), factors)
    np.testing.assert_allclose(alike.starts(0.05, 3.0), means[:1])


def test_samples_lie_within_the_bounds_even_where_the_mean_does_not() -> None:
    far = Mixture(np.ones(1), MIDDLE[np.newaxis] + 5.0, 0.01 * np.eye(10)[np.newaxis])
    samples = far.inside(SPACE, 50, np.random.default_rng(4))
    assert samples.shape == (50, 10)
    np.testing.assert_allclose(SPACE.project(samples), samples, atol=1e-12)


def test_principal_components_are_those_of_the_singular_values() -> None:
    rng = np.random.default_rng(5)
    rows = (rng.normal(size=(600, 4)) @ rng.normal(size=(4, 60))).reshape(600, 2, 30).astype(np.float32)
    projection = Projection.of(rows, np.full(2, 1e-3, np.float32), 4)
    flat = (rows / projection.units[:, np.newaxis]).reshape(600, -1)
    singular = np.linalg.svd(flat - flat.mean(axis=0), compute_uv=False)[:4] / 600**0.5
    np.testing.assert_allclose(projection.deviations, singular, rtol=5e-3)
    features = projection.features(rows)
    # The difference is the half precision of the directions.
    np.testing.assert_allclose(np.cov(features.T), np.eye(4), atol=0.02)


def test_rows_off_the_principal_components_are_far_from_the_training_set() -> None:
    rng = np.random.default_rng(6)
    noise = np.full(2, 0.01, np.float32)
    clean = (rng.normal(size=(600, 4)) @ rng.normal(size=(4, 60))).reshape(600, 2, 30).astype(np.float32)
    rows = (clean + 0.01 * rng.normal(size=clean.shape)).astype(np.float32)
    projection = Projection.of(clean, noise, 4)
    features = projection.features(rows)
    usual = projection.distances(rows, features)
    spoilt = rows[:1].copy()
    spoilt[0, 0, 7] += 3.0
    spike = projection.distances(spoilt, projection.features(spoilt))
    assert spike[0, 1] > 3 * usual[:, 1].max()
    far = 10 * rows[:1]
    assert projection.distances(far, projection.features(far))[0, 0] > usual[:, 0].max()


def test_blocks_are_means_and_noise_falls_with_their_root() -> None:
    rows = np.arange(14.0).reshape(1, 2, 7)
    np.testing.assert_array_equal(in_blocks(rows, 3), [[[1, 4], [8, 11]]])
    setup = short_setup(noise=0.1, adc_bits=None)
    assert noise_rms(setup)[0] == pytest.approx(0.1)
    rounding = noise_rms(short_setup(noise=0.0, adc_bits=8))[0]
    # 45 A twice over 256 steps, whose rounding error is even.
    assert rounding == pytest.approx(90 / 256 / 12**0.5)


def exact_answers(count: int, stated: float, rng: np.random.Generator) -> tuple[list[Mixture], Array]:
    """Return answers with standard deviations `stated` times the right ones, and the truths."""
    answers, truths = [], np.empty((count, 10))
    for i in range(count):
        factor = np.tril(rng.normal(size=(10, 10))) * 3e-3 + 1e-2 * np.eye(10)
        mean = MIDDLE + 0.02 * rng.normal(size=10)
        truths[i] = mean + factor @ rng.normal(size=10)
        answers.append(Mixture(np.ones(1), mean[np.newaxis], stated * factor[np.newaxis]))
    return answers, truths


def test_coverage_and_ranks_accept_correct_and_reject_overconfident_answers() -> None:
    rng = np.random.default_rng(7)
    answers, truths = exact_answers(COUNT, 1.0, rng)
    right = judged(answers, truths, SPACE, rng)
    limits = binom.interval(0.9999, COUNT, 0.95)
    assert np.all((COUNT * right.coverage >= limits[0]) & (COUNT * right.coverage <= limits[1]))
    assert np.all(right.rank_statistic < chi2.ppf(0.9999, 15))
    assert right.rank_limit == pytest.approx(chi2.ppf(0.99, 15), rel=0.03)
    answers, truths = exact_answers(COUNT, 0.5, rng)
    sure = judged(answers, truths, SPACE, rng)
    assert np.all(sure.coverage < 0.8)
    assert np.all(sure.rank_statistic > sure.rank_limit)
    temperature = temperature_of(answers, truths)
    np.testing.assert_allclose(temperature, 2.0, rtol=0.15)
    warmed = judged([one.scaled(temperature) for one in answers], truths, SPACE, rng)
    assert np.all(warmed.coverage > 0.93)


@pytest.mark.parametrize("count", [1, FEW, FEW + 1])
def test_products_of_few_recordings_and_of_many_are_those_of_double_precision(count: int) -> None:
    rng = np.random.default_rng(9)
    # Half precision from its least numbers on, which have a lower precision than the others.
    weight = (rng.normal(size=(70, 33)) * 10.0 ** rng.uniform(-8, 4, (70, 33))).astype(np.float16)
    weight[0, :4] = 0.0, -0.0, 65504.0, -5.960464477539063e-08
    x, bias = rng.normal(size=(count, 70)).astype(np.float32), rng.normal(size=33).astype(np.float32)
    found = Dense(weight.astype(np.float32), bias)(x)
    expected = x.astype(float) @ weight.astype(float) + bias
    scale = np.abs(x).astype(float) @ np.abs(weight).astype(float)
    assert np.all(np.abs(found - expected) <= 1e-6 * scale)
