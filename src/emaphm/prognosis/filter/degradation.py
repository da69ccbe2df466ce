"""Degradation of a unit's components from its diagnoses: a Rao-Blackwellised particle filter.

A particle has a law with its parameters for each component, and one Kalman filter for the levels and rates of
all components together: given the laws, levels and rates are linear-Gaussian, as is a diagnosis, whose full
covariance is used. The filters of all particles are computed together, as arrays.

Each component has its own weights, from the likelihood of its own estimate, and is resampled separately: a
block particle filter [3]. A particle for the full unit would need eight correct laws at once, and many more
particles. The block filter is exact if the estimates of a diagnosis are uncorrelated. If they are correlated,
levels and rates use the full covariance, but the weights of the laws do not use the correlation with the
errors of other components. The two coordinates of an eccentricity share law, parameters, ageing and weights,
the latter from the likelihood of both.

References
----------
[1] Doucet, de Freitas, Murphy, Russell: Rao-Blackwellised particle filtering for dynamic Bayesian networks,
    Conference on Uncertainty in Artificial Intelligence (2000).
[2] Liu, West: Combined parameter and state estimation in simulation-based filtering, in: Sequential Monte
    Carlo Methods in Practice (2001).
[3] Rebeschini, van Handel: Can local particle filters beat the curse of dimensionality?, Annals of Applied
    Probability 25 (2015).
[4] Doucet, Godsill, Andrieu: On sequential Monte Carlo sampling methods for Bayesian filtering, Statistics
    and Computing 10 (2000).
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from emaphm.arrays import Array
from emaphm.prognosis.belief import LEAST_VARIANCE, Belief
from emaphm.prognosis.bounds import to_the_end
from emaphm.prognosis.columns import ECCENTRICITY
from emaphm.prognosis.filter.changes import (
    after_jump,
    after_onset,
    scaled,
    with_broken_rates,
    with_changed_laws,
    with_hypotheses,
)
from emaphm.prognosis.filter.resampling import apart_again, drawn_rows, kinds_of, recombined
from emaphm.prognosis.laws import (
    Mask,
    has_plane,
    in_common,
    is_waiting,
    noises,
    onsets,
    transition,
)
from emaphm.prognosis.prior import EVERY_ROW, NEW
from emaphm.prognosis.settings import AS_ANOTHER, CRACK_GROWTH, EXPONENTIAL, FILTER, POWER_LAW, FilterSettings
from emaphm.prognosis.stress import Exposure
from emaphm.random_streams import stream

LARGEST_LEVEL = 3.0
"""Largest mean and standard deviation of a level; levels are in [-1, 1]."""

LEAST_SURPRISE = 0.01
"""Probability of an outlier or a jump, over all particles, below which a diagnosis is used as stated."""

LARGEST_RATE = 0.05
"""Largest rate [1/h]: a component that is worn out within a day."""


def predicted(belief: Belief, hours: float, exposed: Exposure | None = None) -> Belief:
    """Return the filter state predicted to later flight `hours` [h], with drawn onsets and changes of law.

    A sudden onset occurs with probability 1 - exp(-h/T) in h hours, at a uniformly distributed time; a rate
    breaks as in `breaks`, at the start of the step; a component changes its law with probability 1 -
    exp(-h/`change_hours`). The hours h of a law, of its noise and of an onset are the hours of ageing under
    the stress in `exposed`; without it, they are flight hours. Ageing is uneven: its variance in h hours is
    u² T h, where u is the `unevenness`, and it moves level and rate along the law.
    """
    flown = hours - belief.hours
    if flown <= 0:
        return belief
    belief = with_changed_laws(belief, flown)
    step = np.full(belief.law.shape, flown) if exposed is None else exposed.aged(belief.exponents)
    belief = with_broken_rates(belief, step)
    belief, reach, growth = _with_onsets(belief, step)
    # x⁺ = x + d v, v⁺ = g v: F = [[I, diag d], [0, diag g]], so that P⁺ = F P Fᵀ + Q needs no matrix product.
    across = belief.mixed * reach[:, np.newaxis, :]
    by_rates = belief.rates * reach[:, :, np.newaxis]
    levels = belief.levels + across + np.swapaxes(across, 1, 2) + by_rates * reach[:, np.newaxis, :]
    mixed = (belief.mixed + by_rates) * growth[:, np.newaxis, :]
    rates = belief.rates * growth[:, :, np.newaxis] * growth[:, np.newaxis, :]
    of_age = belief.unevenness**2 * belief.life_scale * step
    by_level, by_rate = reach / step, (growth - 1) / step
    for part, variance, factor in zip(
        (levels, mixed, rates),
        noises(belief.law, belief.life_scale, belief.roughness, step, belief.prior.settings),
        (by_level**2, by_level * by_rate, by_rate**2),
        strict=True,
    ):
        _add_process_noise(part, variance, factor, belief, of_age)
    after = replace(
        belief,
        hours=hours,
        aged=belief.aged + step,
        level=np.clip(belief.level + reach * belief.rate, -LARGEST_LEVEL, LARGEST_LEVEL),
        rate=np.clip(growth * belief.rate, -LARGEST_RATE, LARGEST_RATE),
        levels=levels,
        mixed=mixed,
        rates=rates,
        age_and_level=belief.age_and_level + by_level * belief.rate * of_age,
        steps=belief.steps + 1,
    )
    return _limited(after)


def _with_onsets(belief: Belief, step: Array) -> tuple[Belief, Array, Array]:
    """Return the filter state with the onsets within `step` (n, 8) [h], and the coefficients of `transition`.

    An onset is at a uniformly distributed time, from which on the level changes.
    """
    random = stream(belief.seed, "degradation", belief.steps, "onset")
    sets_in = onsets(belief.law, belief.life_scale, step, random)
    prior = belief.prior
    reach, growth = transition(
        belief.law, belief.life_scale, belief.shape, belief.aged, step, prior.settings, prior.trajectories
    )
    reach = np.where(is_waiting(belief.law), 0.0, reach)
    if sets_in.any():
        belief = after_onset(belief, sets_in, random)
        reach = np.where(sets_in, step * in_common(random.random(reach.shape)), reach)
    return belief, reach, growth


def _add_process_noise(part: Array, variance: Array, factor: Array, belief: Belief, of_age: Array) -> None:
    """Add to a `part` (n, 8, 8) of the covariance the `variance` (n, 8), and the effect of uneven ageing.

    The latter is the `factor` (n, 8) times the variance of the ageing, `of_age` (n, 8) [h²], and the mean
    square of the rate. The coordinates of an eccentricity age together, so that it is also in their
    covariance.
    """
    uneven = of_age * (belief.rate**2 + np.einsum("nii->ni", belief.rates))
    np.einsum("nii->ni", part)[...] += variance + factor * uneven
    if has_plane(of_age.shape[1]):
        x, y = ECCENTRICITY
        expected_product = belief.rate[:, x] * belief.rate[:, y] + belief.rates[:, x, y]
        common = (factor * of_age)[:, x] * expected_product
        part[:, x, y] += common
        part[:, y, x] += common


def updated(belief: Belief, estimate: Array, covariance: Array, settings: FilterSettings = FILTER) -> Belief:
    """Return the filter state updated by a diagnosis; components with few effective particles are resampled.

    Parameters
    ----------
    estimate, covariance
        Estimate (8,) of the levels and its covariance (8, 8), in the coordinates `CARTESIAN_NAMES`. A
        component that was not estimated has a very large variance.
    """
    innovation = estimate - belief.level
    belief, total, log_likelihood = _interpretation(belief, innovation, covariance, settings)
    log_likelihood = log_likelihood + _finished_crack_likelihood(belief, estimate, covariance)
    # With S = L Lᵀ, A = L⁻¹ P and B = L⁻¹ M: P⁺ = P - Aᵀ A, M⁺ = M - Aᵀ B, V⁺ = V - Bᵀ B.
    inverse = _inverse_root(total)
    whitened = inverse @ innovation[:, :, np.newaxis]
    of_levels, of_mixed = inverse @ belief.levels, inverse @ belief.mixed
    to_levels, to_rates = np.swapaxes(of_levels, 1, 2), np.swapaxes(of_mixed, 1, 2)
    levels = belief.levels - to_levels @ of_levels
    rates = belief.rates - to_rates @ of_mixed
    for part, least in ((levels, LEAST_VARIANCE), (rates, 0.0)):
        diagonal = np.einsum("nii->ni", part)
        diagonal[...] = np.maximum(diagonal, least)
    log_weights = belief.log_weights + settings.trust * log_likelihood
    shift = log_weights.max(axis=0)
    log_weights -= shift
    likelihood = np.log(np.exp(log_weights).sum(axis=0))
    log_weights -= likelihood
    after = replace(
        belief,
        level=belief.level + (to_levels @ whitened)[:, :, 0],
        rate=belief.rate + (to_rates @ whitened)[:, :, 0],
        # Symmetrised: rounding errors would grow with the rates of an exponential law.
        levels=(levels + np.swapaxes(levels, 1, 2)) / 2,
        mixed=belief.mixed - to_levels @ of_mixed,
        rates=(rates + np.swapaxes(rates, 1, 2)) / 2,
        aged=np.maximum(
            belief.aged + _ageing_correction(belief.age_and_level, innovation, total), belief.aged / 2
        ),
        age_and_level=np.zeros_like(belief.aged),
        log_weights=log_weights,
        log_likelihood=belief.log_likelihood + shift + likelihood,
        steps=belief.steps + 1,
    )
    few = after.effective_number < settings.effective_share * len(log_weights)
    return _resampled(after, few, settings) if few.any() else after


def _inverse_root(covariances: Array) -> Array:
    """Return L⁻¹ (n, 8, 8) of positive definite `covariances` L Lᵀ, L lower triangular.

    The rows are computed for all particles at once: a LAPACK call for each particle takes several times as
    long.
    """
    root = np.ascontiguousarray(np.moveaxis(np.linalg.cholesky(covariances), 0, -1))
    inverse = np.zeros_like(root)
    for i, row in enumerate(root):
        inverse[i, i] = 1 / row[i]
        inverse[i, :i] = -inverse[i, i] * np.einsum("kn,kjn->jn", row[:i], inverse[:i, :i])
    return np.ascontiguousarray(np.moveaxis(inverse, -1, 0))


class _Interpretation(NamedTuple):
    """Interpretation of a diagnosis by the particles: as stated, as an outlier, or after a jump.

    It has the filter state before the update, the covariances of the innovations (n, 8, 8), and the
    log-likelihood of each component (n, 8).
    """

    before: Belief
    total: Array
    log_likelihood: Array


def _interpretation(
    belief: Belief, innovation: Array, covariance: Array, settings: FilterSettings
) -> _Interpretation:
    """Return a drawn interpretation of a diagnosis of each component by each particle.

    Each of the three cases is drawn with its probability given the innovation, and the particle's likelihood
    is the sum over the cases: the optimal proposal of a particle filter [4]. An outlier adds the variance
    `surprise`² to the diagnosis, a jump adds it to the level (`after_jump`).
    """
    total = belief.levels + covariance
    stated = _own_likelihood(innovation, total)
    odd = settings.outliers + settings.jumps
    belief = replace(belief, surprise=np.zeros(len(stated.T)))
    if not odd:
        return _Interpretation(belief, total, stated)
    more = settings.surprise**2
    widened = _own_likelihood(innovation, total, more) + np.log(odd)
    likelihood = np.logaddexp(stated + np.log1p(-odd), widened)
    probability = np.exp(widened - likelihood)
    weights = np.exp(belief.log_weights + settings.trust * (likelihood - likelihood.max(axis=0)))
    share = (weights * probability).sum(axis=0) / weights.sum(axis=0)
    # A diagnosis with an error of the size of a surprise cannot be a surprise.
    surprising = (share > LEAST_SURPRISE) & (np.diag(covariance) < more)
    if has_plane(surprising.size):
        plane = list(ECCENTRICITY)
        surprising[plane] = surprising[plane].all()
    if not surprising.any():
        return _Interpretation(belief, total, stated)
    likelihood = np.where(surprising, likelihood, stated)
    belief = replace(belief, surprise=np.where(surprising, share, 0.0))
    random = stream(belief.seed, "degradation", belief.steps, "surprises")
    is_odd = surprising & (in_common(random.random(stated.shape)) < probability)
    np.einsum("nii->ni", total)[is_odd] += more
    jumps = is_odd & (in_common(random.random(stated.shape)) < settings.jumps / odd)
    if jumps.any():
        belief = after_jump(belief, jumps, more, settings.law_kept, random)
    return _Interpretation(belief, total, likelihood)


def _own_likelihood(innovation: Array, total: Array, more: float = 0.0) -> Array:
    """Return the log-likelihood of each component, (n, 8), from innovations and their covariances.

    `more` is an additional variance of each component.
    """
    variance = np.einsum("nii->ni", total) + more
    result = np.asarray(-0.5 * (innovation**2 / variance + np.log(variance)))
    if has_plane(innovation.shape[1]):
        (x, y), between = innovation[:, ECCENTRICITY].T, total[:, *ECCENTRICITY]
        of_x, of_y = variance[:, ECCENTRICITY].T
        determinant = of_x * of_y - between**2
        misfit = (of_y * x**2 - 2 * between * x * y + of_x * y**2) / determinant
        result[:, ECCENTRICITY] = -0.5 * (misfit + np.log(determinant))[:, np.newaxis]
    return result


def _finished_crack_likelihood(belief: Belief, estimate: Array, covariance: Array) -> Array:
    """Return the log-likelihood (n, 8) of an estimate for cracks that have become infinite before.

    Such a component is at the end of its scale, independent of the level of its Kalman filter: the error of
    an estimate (8,) is its distance from the end. Both coordinates of an eccentricity have the distance of
    its magnitude, with the variance of the magnitude. The result is 0 for all other components.
    """
    variance = np.diag(covariance).copy()
    if has_plane(variance.size):
        plane = list(ECCENTRICITY)
        of_plane, magnitude = covariance[np.ix_(plane, plane)], float(np.hypot(*estimate[plane]))
        if magnitude > 0:
            direction = estimate[plane] / magnitude
            variance[plane] = direction @ of_plane @ direction
        else:  # no direction: the mean over all directions
            variance[plane] = np.trace(of_plane) / 2
    log_likelihood = -0.5 * to_the_end(estimate, belief.prior.least_friction) ** 2 / variance
    return np.where((belief.law == CRACK_GROWTH) & (belief.life_scale <= belief.aged), log_likelihood, 0.0)


def _ageing_correction(age_and_level: Array, innovation: Array, total: Array) -> Array:
    """Return the corrections (n, 8) of the ageing [h] of components, from the innovations of their levels."""
    result = np.asarray(age_and_level * innovation / np.einsum("nii->ni", total))
    if has_plane(innovation.shape[1]):
        plane = np.ix_(range(len(total)), ECCENTRICITY, ECCENTRICITY)
        inverse = _inverse_root(total[plane])
        by_age, by_level = (
            np.einsum("nij,nj->in", inverse, values[:, ECCENTRICITY])
            for values in (age_and_level, innovation)
        )
        result[:, ECCENTRICITY] = np.sum(by_age * by_level, axis=0)[:, np.newaxis]
    return result


def replaced(belief: Belief, components: Mask) -> Belief:
    """Return the filter state after the replacement of the components for which `components` (8,) is True."""
    n, count = belief.law.shape
    random = stream(belief.seed, "degradation", belief.steps, "replacement")
    where = np.broadcast_to(components, (n, count))
    after = with_hypotheses(belief, EVERY_ROW, where, belief.prior.draw(n, random, count))
    levels, mixed = after.levels.copy(), after.mixed.copy()
    levels[:, components, :] = levels[:, :, components] = 0.0
    mixed[:, components, :] = 0.0
    own = np.flatnonzero(components)
    levels[:, own, own] = belief.prior.settings.new_level**2
    levels += np.where(np.outer(components, components), belief.shared, 0.0)
    return replace(
        after,
        new_at=np.where(components, belief.hours, belief.new_at),
        aged=np.where(components, 0.0, belief.aged),
        age_and_level=np.where(components, 0.0, belief.age_and_level),
        level=np.where(components, NEW[:count], belief.level),
        levels=levels,
        mixed=mixed,
        surprise=np.where(components, 0.0, belief.surprise),
        steps=belief.steps + 1,
    )


def _limited(belief: Belief) -> Belief:
    """Return the filter state with standard deviations of at most `LARGEST_LEVEL` and `LARGEST_RATE`.

    Otherwise, variances that grow exponentially over a long gap between diagnoses would leave the range in
    which the next update is computed without loss of digits.
    """
    of_level = np.sqrt(np.einsum("nii->ni", belief.levels))
    of_rate = np.sqrt(np.einsum("nii->ni", belief.rates))
    rows = np.flatnonzero(((of_level > LARGEST_LEVEL) | (of_rate > LARGEST_RATE)).any(axis=1))
    if not rows.size:
        return belief
    return scaled(
        belief,
        rows,
        LARGEST_LEVEL / np.maximum(of_level[rows], LARGEST_LEVEL),
        LARGEST_RATE / np.maximum(of_rate[rows], LARGEST_RATE),
    )


def _resampled(belief: Belief, few: Mask, settings: FilterSettings) -> Belief:
    """Return the filter state with the components `few` (8,) resampled, and their copies jittered."""
    random = stream(belief.seed, "degradation", belief.steps, "resampling")
    n = len(belief.law)
    rows = drawn_rows(belief, n, random)
    rows[:, ~few] = np.arange(n)[:, np.newaxis]
    after = recombined(belief, rows)
    s = belief.prior.settings
    # Groups have the same law and, for the trajectory of another unit, the same unit.
    groups = after.law * (1 + after.shape.max()) + np.where(after.law == AS_ANOTHER, after.shape, 0.0)
    kinds = kinds_of(groups, few)

    def apart(values: Array) -> Array:
        return in_common(apart_again(values, kinds, settings, random))

    ranges = {EXPONENTIAL: s.growth, POWER_LAW: s.exponent, CRACK_GROWTH: s.crack}
    shape = np.where(np.isin(after.law, list(ranges)), apart(after.shape), after.shape)
    for law, ends in ranges.items():
        shape = np.where(after.law == law, np.clip(shape, *ends), shape)
    scale = apart(after.life_scale)
    # The kernel must not end a crack: such a copy keeps its life scale.
    ends = (after.law == CRACK_GROWTH) & (scale <= after.aged)
    scale = np.where(ends, after.life_scale, scale)
    return replace(
        after,
        # The life scale of another unit's trajectory is about the span of that unit, which may be short.
        life_scale=np.where(after.law == AS_ANOTHER, scale, np.clip(scale, *s.life_scale)),
        shape=shape,
        roughness=np.clip(apart(after.roughness), *s.roughness),
        unevenness=np.clip(apart(after.unevenness), *s.unevenness),
        exponents=_jittered(after, few, settings, random),
        log_weights=np.where(few, -np.log(n), belief.log_weights),
    )


def _jittered(belief: Belief, few: Mask, settings: FilterSettings, random: np.random.Generator) -> Array:
    """Return the exponents of the stress (n, 8, 3), jittered for the components `few` (8,)."""
    if belief.prior.reference is None:
        return belief.exponents
    low, high = np.array(belief.prior.settings.exponents).T
    shift = settings.exponent_jitter * (high - low)
    shift = shift * in_common(random.standard_normal(belief.exponents.shape))
    return np.where(few[:, np.newaxis], np.clip(belief.exponents + shift, low, high), belief.exponents)
