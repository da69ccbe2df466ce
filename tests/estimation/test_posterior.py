"""Sampled posteriors against closed forms and numerical integration, and their diagnostics and reports."""

import importlib
import json
import sys
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest
from scipy.stats import norm, truncnorm

from cases import THESIS
from emaphm.actuator import NAMES, Actuator, Chirp, Faults
from emaphm.arrays import Array
from emaphm.diagnosis import Diagnosis, diagnose
from emaphm.errors import MethodError
from emaphm.estimation.posterior import mcmc
from emaphm.estimation.posterior.credible_intervals import shortest_arc, shortest_interval
from emaphm.estimation.posterior.mcmc import MCMC, McmcSettings, sample
from emaphm.estimation.posterior.mcmc_diagnostics import McmcDiagnostics, autocorrelation_time, split_r_hat
from emaphm.estimation.posterior.samples import Posterior
from emaphm.estimation.space.nuisances import PRIORS_PER_UNIT, NuisanceSet
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

if TYPE_CHECKING:
    from emaphm.estimation.objective import MapObjective

SPACE = ParameterSpace.of(THESIS, NuisanceSet.of(THESIS, ("load",), ()))
D = SPACE.dimensions
X, Y = SPACE.columns.index(5), SPACE.columns.index(6)
MIDDLE = np.array([0.4, 0.5, 0.3, 0.5, 0.4, 0.3, 0.2, 0.5, 0.02])

FAR = 4.5
"""Bound in Monte Carlo standard errors: one of 1500 sets of a hundred normal values exceeds it."""


@dataclass(frozen=True, eq=False)
class Linear:
    """An objective whose outputs are linear in its points: least squares end at `optimum` (d,)."""

    derivatives: Array
    optimum: Array
    space: ParameterSpace = SPACE

    @property
    def channel_rows(self) -> int:
        """Number of recorded rows."""
        return int(self.derivatives.shape[1])

    @property
    def target(self) -> Array:
        """Recorded rows: the model's outputs at the optimum, and a residual orthogonal to its derivatives."""
        other = np.random.default_rng(1).normal(size=self.channel_rows)
        basis = np.linalg.qr(self.derivatives.T)[0]
        return np.asarray(self.optimum @ self.derivatives + other - basis @ (basis.T @ other))

    def outputs(self, points: Array) -> Array:
        """Return the rows of the model at `points`."""
        return np.asarray(points @ self.derivatives)


def sampled(optimum: Array, information: Array, seed: int = 0, settings: McmcSettings = MCMC) -> Posterior:
    """Return the posterior of a recording with the inverse covariance `information` (d, d)."""
    derivatives = np.random.default_rng(0).normal(size=(D, 60))
    objective = cast("MapObjective", Linear(derivatives, optimum))
    point, correction = SPACE.project(optimum), np.zeros(60)
    return sample(objective, point, correction, covariance_of(information), seed, settings=settings)


def covariance_of(information: Array) -> Array:
    """Return the covariance of an estimate, including the normal prior of each coordinate."""
    return np.asarray(np.linalg.inv(information + np.diag([12.0] * (D - 1) + [PRIORS_PER_UNIT**2])), float)


def informed(deviations: Array, seed: int = 3) -> Array:
    """Return an information matrix (d, d) of correlated parameters with about the given `deviations` (d,)."""
    mixed = np.eye(D) + 0.3 * np.random.default_rng(seed).normal(size=(D, D))
    return np.asarray((mixed / deviations).T @ (mixed / deviations))


def closed_form(optimum: Array, information: Array) -> tuple[Array, Array]:
    """Return mean (d,) and covariance (d, d) of the posterior about `optimum`, far from all bounds.

    The priors of the faults are uniform; the prior of the load is normal about 0.
    """
    precision = information + np.diag([0.0] * (D - 1) + [PRIORS_PER_UNIT**2])
    mean = np.linalg.solve(precision, information @ optimum)
    return np.asarray(mean, float), np.asarray(np.linalg.inv(precision), float)


def effective(posterior: Posterior) -> float:
    assert posterior.diagnostics
    return float(np.min(posterior.diagnostics.effective_samples))


@pytest.fixture(scope="module")
def normal() -> tuple[Array, Posterior]:
    information = informed(np.array([0.01, 0.02, 0.03, 0.02, 0.01, 0.02, 0.01, 0.004, 0.15]))
    return information, sampled(MIDDLE, information)


def test_mean_and_covariance_are_those_of_the_closed_form(normal: tuple[Array, Posterior]) -> None:
    information, posterior = normal
    assert posterior.diagnostics
    assert posterior.diagnostics.converged
    mean, covariance = closed_form(MIDDLE, information)
    deviations, count = np.sqrt(np.diag(covariance)), effective(posterior)
    deviation = (posterior.samples.mean(axis=0) - mean) / deviations * np.sqrt(count)
    assert np.all(np.abs(deviation) < FAR)
    correlation = covariance / np.outer(deviations, deviations)
    sample_correlation = np.cov(posterior.samples.T) / np.outer(deviations, deviations)
    # For normal samples, n Var(s_ij) = s_ii s_jj + s_ij².
    assert np.all(np.abs(sample_correlation - correlation) < FAR * np.sqrt((1 + correlation**2) / count))


def test_the_seed_determines_the_samples(normal: tuple[Array, Posterior]) -> None:
    short = McmcSettings(first_check=60, most_steps=60)
    first, again, other = (sampled(MIDDLE, normal[0], seed, short).samples for seed in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_correction_moves_the_optimum_by_its_step() -> None:
    information = informed(np.full(D, 0.02), seed=5)  # this matrix requires few steps
    objective = Linear(np.random.default_rng(0).normal(size=(D, 60)), MIDDLE)
    shift = np.full(D, 0.01)
    moved = sample(
        cast("MapObjective", objective), MIDDLE, -shift @ objective.derivatives, covariance_of(information), 0
    )
    mean, covariance = closed_form(MIDDLE + shift, information)
    off = (moved.samples.mean(axis=0) - mean) / np.sqrt(np.diag(covariance)) * np.sqrt(effective(moved))
    assert np.all(np.abs(off) < FAR)


def test_at_a_bound_the_posterior_is_the_truncated_normal() -> None:
    deviations = np.full(D, 0.02)
    optimum = MIDDLE.copy()
    # Beyond a bound, on it, half a standard deviation within it, and beyond the other bound.
    places = {"friction": -0.46, "backlash": 0.0, "short_a": 0.01, "gain": 1.02}
    for name, place in places.items():
        optimum[SPACE.columns.index(NAMES.index(name))] = place
    posterior = sampled(optimum, np.diag(deviations**-2))
    assert posterior.diagnostics
    assert posterior.diagnostics.converged
    count = effective(posterior)
    for name, place in places.items():
        lowest = -0.45 if name == "friction" else 0.0
        exact = truncnorm((lowest - place) / 0.02, (1 - place) / 0.02, place, 0.02)
        values = posterior.components[:, NAMES.index(name)]
        assert abs(values.mean() - exact.mean()) < FAR * exact.std() / np.sqrt(count)
        # The shortest interval begins at the bound: its other end has the error of a quantile.
        upper = name == "gain"
        end = float(exact.ppf(0.05 if upper else 0.95))
        error = np.sqrt(0.05 * 0.95 / count) / exact.pdf(end)
        low, high = posterior.interval95[name]
        assert (high if upper else low) == (1.0 if upper else lowest)
        assert abs((low if upper else high) - end) < FAR * error


def polar(optimum: Array, block: Array) -> tuple[Array, Array, Array]:
    """Return radii, phases [turns, 0 to 1] and the normal density times the radius on their grid."""
    radii = np.linspace(0, 0.2, 801)[1:]
    turns = (np.arange(720) + 0.5) / 720
    angles = (2 * turns - 1) * np.pi
    points = radii[:, np.newaxis, np.newaxis] * np.stack([np.cos(angles), np.sin(angles)], axis=-1) - optimum
    density = np.exp(-np.einsum("rti,ij,rtj->rt", points, block, points) / 2) * radii[:, np.newaxis]
    return radii, turns, density / density.sum()


NONE, SMALL, CLEAR = (0.0, 0.0), (0.02, 0.01), (-0.08, 0.005)
"""Optima (x, y) of an eccentricity."""


@cache
def eccentric(optimum: tuple[float, float]) -> tuple[Posterior, Array, Array, Array]:
    """Return the posterior at an optimum of the eccentricity, and its numerical density by `polar`."""
    information = np.diag(np.full(D, 0.02) ** -2)
    block = np.asarray(np.linalg.inv(0.02**2 * np.array([[1.0, 0.3], [0.3, 0.7]])), float)
    information[X : Y + 1, X : Y + 1] = block
    centre = MIDDLE.copy()
    centre[X : Y + 1] = optimum
    return sampled(centre, information), *polar(np.array(optimum), block)


def sampling_error(posterior: Posterior) -> float:
    """Return the bound on the error of the mass within an interval of 95 %, by the number of samples."""
    return float(FAR * np.sqrt(0.05 * 0.95 / effective(posterior)))


@pytest.mark.parametrize(
    ("optimum", "may_be_none"), [(NONE, True), (SMALL, True), (CLEAR, False)], ids=["none", "small", "clear"]
)
def test_the_interval_of_an_eccentricity_agrees_with_numerical_integration(
    optimum: tuple[float, float], may_be_none: bool
) -> None:
    posterior, radii, _, density = eccentric(optimum)
    # In the numerical density, the mass within the interval is also 95 % within its sampling error.
    error = sampling_error(posterior)
    low, high = posterior.interval95["eccentricity"]
    radial = density.sum(axis=1)
    grid = 2 * float(radial.max())  # an end lies between two radii
    assert radial[(radii >= low) & (radii <= high)].sum() == pytest.approx(0.95, abs=error + grid)
    # Whether the density per area at 0 is among the densest 95 %.
    area = radial / radii
    densest = np.argsort(area)[::-1]
    least = area[densest][np.searchsorted(np.cumsum(radial[densest]), 0.95)]
    assert bool(area[0] > least) is may_be_none
    assert (low == 0) is may_be_none


def numerical_arc(density: Array) -> float:
    """Return the length of the shortest arc [turns] that has 95 % of a density over radii and phases."""
    phase_density = density.sum(axis=0)
    return float(np.searchsorted(np.cumsum(np.sort(phase_density)[::-1]), 0.95) / phase_density.size)


@pytest.mark.parametrize("optimum", [SMALL, CLEAR], ids=["small", "clear"])
def test_the_direction_of_an_eccentricity_agrees_with_numerical_integration(
    optimum: tuple[float, float],
) -> None:
    posterior, _, turns, density = eccentric(optimum)
    phase_density = density.sum(axis=0)
    low, high = posterior.interval95["eccentricity_phase"]
    mass = phase_density[(turns - low) % 1 <= high - low].sum()
    assert mass == pytest.approx(0.95, abs=sampling_error(posterior) + 2 * float(phase_density.max()))
    # The length changes slowly about its minimum: a few percent for the sampling error of the mass.
    assert high - low == pytest.approx(numerical_arc(density), rel=0.08)


def test_the_direction_of_no_eccentricity_is_the_whole_circle() -> None:
    posterior, _, _, density = eccentric(NONE)
    assert (
        numerical_arc(density) > 0.92
    )  # well above the length from which an arc is reported as the whole circle
    assert posterior.interval95["eccentricity_phase"] == (0.0, 1.0)


def test_intervals_are_the_shortest_and_may_end_at_a_bound() -> None:
    rng = np.random.default_rng(0)
    values = rng.normal(0.5, 0.02, 100_000)
    # A quantile of 100,000 normal values has an error of 0.9 % of their deviation, the shortest pair more.
    assert shortest_interval(values) == pytest.approx(norm.interval(0.95, 0.5, 0.02), abs=0.002)
    assert shortest_interval(np.abs(values - 0.5)) == pytest.approx((0, 1.96 * 0.02), abs=5e-4)
    assert shortest_interval(1 - np.abs(values - 0.5)) == pytest.approx((1 - 1.96 * 0.02, 1), abs=5e-4)
    radii = np.hypot(*rng.normal(0, 0.02, (2, 100_000)))
    # For a uniform prior on a disk, the interval from the centre to the quantile of Rayleigh's distribution.
    assert shortest_interval(radii, power=2) == pytest.approx(
        (0, 0.02 * np.sqrt(-2 * np.log(0.05))), abs=5e-4
    )


def test_without_information_the_interval_is_the_whole_range() -> None:
    even = np.random.default_rng(0).random(10_000)
    assert shortest_interval(even) == (0.0, 1.0)
    assert shortest_interval(np.sqrt(even), power=2) == (0.0, 1.0)  # radii of a uniform disk
    low, high = shortest_interval(0.5 + 0.5 * even)
    # The interval that ends at the bound is at most slightly longer than the shortest.
    assert high - low == pytest.approx(0.475, rel=0.02)


def test_the_shortest_arc_may_pass_the_end_of_its_scale() -> None:
    turns = np.random.default_rng(0).normal(0.99, 0.03, 100_000)
    (low, high), median = shortest_arc(turns % 1)
    assert (low, high) == pytest.approx(norm.interval(0.95, 0.99, 0.03), abs=0.003)
    assert median == pytest.approx(0.99, abs=1e-3)
    assert shortest_arc(np.random.default_rng(0).random(10_000))[0] == (0.0, 1.0)


# Diagnostics of the chains.


def chains(rho: float, steps: int) -> Array:
    """Return stationary autoregressions (steps, 32, 2)."""
    rng = np.random.default_rng(0)
    chain = np.empty((steps, 32, 2))
    chain[0] = rng.normal(size=(32, 2))
    for i in range(1, steps):
        chain[i] = rho * chain[i - 1] + np.sqrt(1 - rho**2) * rng.normal(size=(32, 2))
    return chain


def test_the_autocorrelation_time_of_an_autoregression_is_the_closed_form() -> None:
    # (1 + rho) / (1 - rho) = 19; its error is sqrt(2 (2 m + 1) / n), with a window m of 5 times this: 6 %.
    assert autocorrelation_time(chains(0.9, 2000)) == pytest.approx(19.0, rel=0.12)
    assert McmcDiagnostics.of(chains(0.9, 2000), 0.3, 2500).converged


def test_a_chain_cut_short_has_not_converged() -> None:
    short = McmcDiagnostics.of(chains(0.99, 500), 0.3, 500)  # 500 steps of 199 autocorrelation times
    assert not short.converged
    assert np.all(short.r_hat > 1.05)
    assert "has NOT converged in 500 steps" in str(short)


def test_separate_or_constant_walkers_have_not_converged() -> None:
    separate = chains(0.5, 2000)
    assert split_r_hat(separate) == pytest.approx(1.0, abs=0.01)
    separate[:, :3] += 5.0
    assert np.all(split_r_hat(separate) > 1.5)
    assert not McmcDiagnostics.of(separate, 0.3, 2000).converged
    still = chains(0.5, 2000)
    still[:] = still[0]
    frozen = McmcDiagnostics.of(still, 0.0, 2000)
    assert not frozen.converged
    json.dumps(frozen.to_dict(), allow_nan=False)


def test_sampling_stops_at_its_maximum_of_steps_with_a_note() -> None:
    progress: list[float] = []
    objective = cast("MapObjective", Linear(np.random.default_rng(0).normal(size=(D, 60)), MIDDLE))
    cut = sample(
        objective,
        MIDDLE,
        np.zeros(60),
        np.eye(D) * 1e-4,
        0,
        progress.append,
        McmcSettings(first_check=60, most_steps=60),
    )
    assert cut.diagnostics
    assert not cut.diagnostics.converged
    assert cut.diagnostics.steps == 60
    assert progress == sorted(progress)
    assert progress[-1] == 1.0
    assert any("NOT converged" in line for line in cut.notes(cut.interval95))


# Posteriors of recordings.


@pytest.fixture(scope="module")
def diagnosed() -> Diagnosis:
    truth = Faults(0.4, 0.3, 0.2, 0.3, 0.0, 0.01, 0.2, 0.6)
    whole = simulate(THESIS, Chirp(duration=0.1), faults=truth, duration=0.1, noise=0.2)
    rows = {name: whole[name] for name in ("time_s", "command_rad", "current_A", "voltage_V")}
    return diagnose(Recording(rows), THESIS, nuisances=(), workers=1, posterior=True)


def test_posterior_and_normal_intervals_agree_for_well_identified_faults(diagnosed: Diagnosis) -> None:
    posterior = diagnosed.posterior
    assert posterior is not None
    assert posterior.diagnostics
    assert posterior.diagnostics.converged
    strong = ("friction", "backlash", "short_a", "short_b", "gain")
    for name in strong:
        low, high = posterior.interval95[name]
        assert low < diagnosed.components[name].value < high
        # The sampled mean of a linear model equals the estimate. Kinks of stick-slip move it by less
        # than one standard error of the data; half an interval is two standard errors.
        ends = np.array(diagnosed.interval[name])
        assert np.all(np.abs(np.array([low, high]) - ends) < 0.5 * np.ptp(ends))
    # A short cannot be negative: samples are within the bounds, and half the normal interval is outside.
    assert posterior.interval95["short_c"][0] == 0.0
    assert posterior.median["short_c"] > 0.0


def test_a_diagnosis_reports_its_posterior_in_text_and_json(diagnosed: Diagnosis) -> None:
    posterior = diagnosed.posterior
    assert posterior is not None
    read = json.loads(diagnosed.to_json(), parse_constant=pytest.fail)["posterior"]
    assert list(read["faults"]) == list(NAMES)
    assert read["convergence"]["converged"] is True
    assert len(read["convergence"]["r_hat"]) == len(diagnosed.coordinates)
    text = str(diagnosed)
    assert "Sampled posterior: " in text
    for name in posterior.differing(diagnosed.interval):
        assert f"\n{name}: " in text
    assert diagnosed.evaluations > 10_000
    assert "posterior" not in replace(diagnosed, posterior=None).to_dict()


def test_the_number_of_workers_changes_no_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    short = partial(mcmc.sample, settings=McmcSettings(first_check=40, most_steps=40))
    monkeypatch.setattr(mcmc, "sample", short)
    # A recording this short would be computed without threads otherwise.
    monkeypatch.setattr(importlib.import_module("emaphm.simulation.engine.running"), "WORTH_A_THREAD", 0)
    recording = simulate(THESIS, Chirp(duration=0.1), model="averaged", duration=0.1, noise=0.05)
    alone, together = (
        diagnose(recording, THESIS, max_corrections=0, workers=workers, posterior=True).posterior
        for workers in (1, 2)
    )
    assert alone is not None
    assert together is not None
    np.testing.assert_array_equal(alone.samples, together.samples)


def test_only_intervals_that_differ_are_reported(normal: tuple[Array, Posterior]) -> None:
    _, posterior = normal
    assert posterior.differing(posterior.interval95) == ()
    low, high = posterior.interval95["friction"]
    off = {**posterior.interval95, "friction": (low - 0.4 * (high - low), high)}
    assert posterior.differing(off) == ("friction",)
    phase = posterior.interval95["eccentricity_phase"]
    once_round = {**posterior.interval95, "eccentricity_phase": (phase[0] - 1, phase[1] - 1)}
    assert posterior.differing(once_round) == ()


def bare() -> Actuator:
    return THESIS.model_copy(update={"electrical": None})


def test_a_component_without_effect_keeps_its_whole_range() -> None:
    space = ParameterSpace.of(bare())
    samples = np.random.default_rng(0).random((500, space.dimensions))
    posterior = Posterior.of(space, samples, McmcDiagnostics.of(chains(0.5, 400), 0.3, 500))
    assert posterior.interval95["short_a"] == (0.0, 1.0)
    assert posterior.components.shape == (500, 8)


@pytest.mark.parametrize("options", [{"model": "monitor", "method": "dragonfly"}])
def test_the_monitor_model_is_refused(options: dict[str, Any]) -> None:
    recording = simulate(THESIS, Chirp(), model="averaged")
    with pytest.raises(MethodError, match="monitor model's switching makes useless; use the averaged model"):
        diagnose(recording, THESIS, posterior=True, **options)


def test_a_missing_library_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    recording = simulate(THESIS, Chirp(), model="averaged")
    monkeypatch.setitem(sys.modules, "emcee", None)  # makes its import fail
    with pytest.raises(MethodError) as caught:
        diagnose(recording, THESIS, posterior=True)
    message = "a posterior needs the library 'emcee'; install it with: pip install 'emaphm[posterior]'"
    assert str(caught.value) == message
