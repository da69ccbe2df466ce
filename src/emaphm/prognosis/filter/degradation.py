"""Degradation of a unit's components from its diagnoses: a Rao-Blackwellised particle filter.

A particle holds a law with its parameters for each component, and one Kalman filter for the levels and rates
of all components together: given the laws they are linear-Gaussian, and so is a diagnosis, whose full
covariance is taken. All particles' filters advance together, as arrays.

Each component has weights of its own, from the likelihood of its own estimate, and is resampled on its own: a
block particle filter [3]. A whole unit's particle would have to be right in eight laws at once, which needs
many times as many. This is exact where the estimates of a diagnosis are uncorrelated. Where they are
correlated, levels and rates take all of the covariance, and only the choice between laws does without what
the others' errors say. The two coordinates of an eccentricity are one growth: they have law, parameters,
ageing and weights in common, the latter from the likelihood of both.

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
    noises,
    transition,
)
from emaphm.prognosis.prior import EVERY_ROW, NEW, is_waiting
from emaphm.prognosis.settings import AS_ANOTHER, CRACK_GROWTH, EXPONENTIAL, FILTER, POWER_LAW, FilterSettings
from emaphm.prognosis.stress import Exposure
from emaphm.random_streams import stream

LARGEST_LEVEL = 3.0
"""Mean and standard deviation of a level that are distinguished from larger ones: levels are in [-1, 1]."""

LEAST_SURPRISE = 0.01
"""Probability of an outlier or a jump, of all particles, below which a diagnosis is taken as stated."""

LARGEST_RATE = 0.05
"""Of a rate [1/h]: a component that is worn out within a day."""


def predicted(belief: Belief, hours: float, exposed: Exposure | None = None) -> Belief:
    """Return the belief at later flight `hours` [h]: onsets and changes of law are drawn, the rest follows.

    A component of sudden onset sets in with probability 1 - exp(-h/T) in h hours, at a moment of which each
    is equally likely; a rate breaks as in `breaks`, when the step begins; any component takes up another law
    with probability 1 - exp(-h/`change_hours`). The hours h of a law, of its noise and of an onset are those
    by which the component ages under the stress that it was `exposed` to; flight hours where that is left
    out. Ageing is uneven: its variance in h hours is u² T h, u being the `unevenness`, and moves level and
    rate along the law.
    """
    flown = hours - belief.hours
    if flown <= 0:
        return belief
    belief = with_changed_laws(belief, flown)
    step = np.full(belief.law.shape, flown) if exposed is None else exposed.aged(belief.exponents)
    random = stream(belief.seed, "degradation", belief.steps, "onset")
    s = belief.prior.settings
    belief = with_broken_rates(belief, step)
    sets_in = is_waiting(belief.law) & (
        in_common(random.random(belief.law.shape)) < -np.expm1(-step / belief.life_scale)
    )
    reach, growth = transition(
        belief.law, belief.life_scale, belief.shape, belief.aged, step, s, belief.prior.trajectories
    )
    reach = np.where(is_waiting(belief.law), 0.0, reach)
    if sets_in.any():
        belief = after_onset(belief, sets_in, random)
        reach = np.where(sets_in, step * in_common(random.random(reach.shape)), reach)
    # x⁺ = x + d v, v⁺ = g v: F = [[I, diag d], [0, diag g]], so that P⁺ = F P Fᵀ + Q needs no matrix product.
    across = belief.mixed * reach[:, np.newaxis, :]
    by_rates = belief.rates * reach[:, :, np.newaxis]
    levels = belief.levels + across + np.swapaxes(across, 1, 2) + by_rates * reach[:, np.newaxis, :]
    mixed = (belief.mixed + by_rates) * growth[:, np.newaxis, :]
    rates = belief.rates * growth[:, :, np.newaxis] * growth[:, np.newaxis, :]
    own = np.einsum("nii->ni", belief.rates)
    of_age = belief.unevenness**2 * belief.life_scale * step
    by_level, by_rate = reach / step, (growth - 1) / step
    uneven = of_age * (belief.rate**2 + own)
    wiener = noises(belief.law, belief.life_scale, belief.roughness, step, s)
    for part, variance, more in zip(
        (levels, mixed, rates), wiener, (by_level**2, by_level * by_rate, by_rate**2), strict=True
    ):
        np.einsum("nii->ni", part)[...] += variance + more * uneven
        if has_plane(step.shape[1]):
            x, y = ECCENTRICITY
            both = belief.rate[:, x] * belief.rate[:, y] + belief.rates[:, x, y]
            common = (more * of_age)[:, x] * both
            part[:, x, y] += common
            part[:, y, x] += common
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


def updated(belief: Belief, estimate: Array, covariance: Array, settings: FilterSettings = FILTER) -> Belief:
    """Return the belief after a diagnosis at its hours; a component that few particles carry is resampled.

    Parameters
    ----------
    estimate, covariance
        Of the levels, (8,) and (8, 8), in the coordinates `CARTESIAN_NAMES`. A component that was not seen
        has a very large variance.
    """
    innovation = estimate - belief.level
    belief, total, log_likelihood = _taken(belief, innovation, covariance, settings)
    log_likelihood = log_likelihood + _cracked_through(belief, estimate, covariance)
    # With S = L Lᵀ, A = L⁻¹ P and B = L⁻¹ M: P⁺ = P - Aᵀ A, M⁺ = M - Aᵀ B, V⁺ = V - Bᵀ B.
    inverse = _inverse_root(total)
    seen = inverse @ innovation[:, :, np.newaxis]
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
        level=belief.level + (to_levels @ seen)[:, :, 0],
        rate=belief.rate + (to_rates @ seen)[:, :, 0],
        # Kept symmetric: what rounding leaves would grow with the rates of an exponential law.
        levels=(levels + np.swapaxes(levels, 1, 2)) / 2,
        mixed=belief.mixed - to_levels @ of_mixed,
        rates=(rates + np.swapaxes(rates, 1, 2)) / 2,
        aged=np.maximum(belief.aged + _age_seen(belief.age_and_level, innovation, total), belief.aged / 2),
        age_and_level=np.zeros_like(belief.aged),
        log_weights=log_weights,
        log_likelihood=belief.log_likelihood + shift + likelihood,
        steps=belief.steps + 1,
    )
    few = after.effective_number < settings.effective_share * len(log_weights)
    return _resampled(after, few, settings) if few.any() else after


def _inverse_root(covariances: Array) -> Array:
    """Return L⁻¹ (n, 8, 8) of positive definite `covariances` L Lᵀ, L lower triangular.

    Row by row, for all particles at once: a call of LAPACK for each takes several times as long.
    """
    root = np.ascontiguousarray(np.moveaxis(np.linalg.cholesky(covariances), 0, -1))
    inverse = np.zeros_like(root)
    for i, row in enumerate(root):
        inverse[i, i] = 1 / row[i]
        inverse[i, :i] = -inverse[i, i] * np.einsum("kn,kjn->jn", row[:i], inverse[:i, :i])
    return np.ascontiguousarray(np.moveaxis(inverse, -1, 0))


class _Taken(NamedTuple):
    """How the particles take a diagnosis.

    The belief before it, the innovations' covariances (n, 8, 8), each component's own logarithm of the
    likelihood (n, 8).
    """

    before: Belief
    total: Array
    log_likelihood: Array


def _taken(belief: Belief, innovation: Array, covariance: Array, settings: FilterSettings) -> _Taken:
    """Return how particles take a diagnosis of each component: as stated, as an outlier, or after a jump.

    Which of them is drawn with its probability given the innovation, and the particle's likelihood is their
    sum: the optimal proposal of a particle filter [4]. An outlier adds the variance `surprise`² to the
    diagnosis, a jump adds it to the level; with a jump, degradation sets in as after a sudden onset.
    """
    total = belief.levels + covariance
    stated = _own_likelihood(innovation, total)
    odd = settings.outliers + settings.jumps
    belief = replace(belief, surprise=np.zeros(len(stated.T)))
    if not odd:
        return _Taken(belief, total, stated)
    more = settings.surprise**2
    widened = _own_likelihood(innovation, total, more) + np.log(odd)
    likelihood = np.logaddexp(stated + np.log1p(-odd), widened)
    probability = np.exp(widened - likelihood)
    weights = np.exp(belief.log_weights + settings.trust * (likelihood - likelihood.max(axis=0)))
    share = (weights * probability).sum(axis=0) / weights.sum(axis=0)
    # What is known no better than by a surprise cannot surprise.
    surprising = (share > LEAST_SURPRISE) & (np.diag(covariance) < more)
    if has_plane(surprising.size):
        plane = list(ECCENTRICITY)
        surprising[plane] = surprising[plane].all()
    if not surprising.any():
        return _Taken(belief, total, stated)
    likelihood = np.where(surprising, likelihood, stated)
    belief = replace(belief, surprise=np.where(surprising, share, 0.0))
    random = stream(belief.seed, "degradation", belief.steps, "surprises")
    is_odd = surprising & (in_common(random.random(stated.shape)) < probability)
    np.einsum("nii->ni", total)[is_odd] += more
    jumps = is_odd & (in_common(random.random(stated.shape)) < settings.jumps / odd)
    if jumps.any():
        belief = after_onset(belief, jumps, random)
        levels = belief.levels.copy()
        np.einsum("nii->ni", levels)[jumps] += more
        belief = replace(belief, levels=levels)
    return _Taken(belief, total, likelihood)


def _own_likelihood(innovation: Array, total: Array, more: float = 0.0) -> Array:
    """Return the logarithm of each component's own likelihood, (n, 8), of the innovations' covariances.

    `more` is a further variance of each.
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


def _cracked_through(belief: Belief, estimate: Array, covariance: Array) -> Array:
    """Return the logarithm of how likely an estimate is where a crack has become infinite before, (n, 8).

    Such a component is at the end of its scale, whatever the level that its Kalman filter goes on with: an
    estimate (8,) below that is off by its distance from there. 0 for all others.
    """
    far = -0.5 * to_the_end(estimate, belief.prior.least_friction) ** 2 / np.diag(covariance)
    return np.where((belief.law == CRACK_GROWTH) & (belief.life_scale <= belief.aged), far, 0.0)


def _age_seen(age_and_level: Array, innovation: Array, total: Array) -> Array:
    """Return by how many hours [h] components have aged more than expected, (n, 8), as their levels say."""
    result = np.asarray(age_and_level * innovation / np.einsum("nii->ni", total))
    if has_plane(innovation.shape[1]):
        plane = np.ix_(range(len(total)), ECCENTRICITY, ECCENTRICITY)
        inverse = _inverse_root(total[plane])
        by_age, by_level = (
            np.einsum("nij,nj->in", inverse, one[:, ECCENTRICITY]) for one in (age_and_level, innovation)
        )
        result[:, ECCENTRICITY] = np.sum(by_age * by_level, axis=0)[:, np.newaxis]
    return result


def replaced(belief: Belief, components: Mask) -> Belief:
    """Return the belief after the replacement of `components`, (8,) of True and False, at its hours."""
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
        steps=belief.steps + 1,
    )


def _limited(belief: Belief) -> Belief:
    """Return the belief with no standard deviation above `LARGEST_LEVEL` or `LARGEST_RATE`.

    What grows exponentially over a long gap between diagnoses would else leave the range in which the next
    update is computed without loss of digits.
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
    """Return a belief whose components `few` (8,) are resampled, and their copies differ a little."""
    random = stream(belief.seed, "degradation", belief.steps, "resampling")
    n = len(belief.law)
    rows = drawn_rows(belief, n, random)
    rows[:, ~few] = np.arange(n)[:, np.newaxis]
    after = recombined(belief, rows)
    s = belief.prior.settings
    # Of the same law, and of the same other unit where that is it.
    groups = after.law * (1 + after.shape.max()) + np.where(after.law == AS_ANOTHER, after.shape, 0.0)
    kinds = kinds_of(groups, few)

    def apart(values: Array) -> Array:
        return in_common(apart_again(values, kinds, settings, random))

    ranges = {EXPONENTIAL: s.growth, POWER_LAW: s.exponent, CRACK_GROWTH: s.crack}
    shape = np.where(np.isin(after.law, list(ranges)), apart(after.shape), after.shape)
    for law, ends in ranges.items():
        shape = np.where(after.law == law, np.clip(shape, *ends), shape)
    scale = apart(after.life_scale)
    # A kernel must not end a crack: where it would, the copy stays as it is.
    ends = (after.law == CRACK_GROWTH) & (scale <= after.aged)
    scale = np.where(ends, after.life_scale, scale)
    return replace(
        after,
        # The time of another unit's way is about what that unit took, however short.
        life_scale=np.where(after.law == AS_ANOTHER, scale, np.clip(scale, *s.life_scale)),
        shape=shape,
        roughness=np.clip(apart(after.roughness), *s.roughness),
        unevenness=np.clip(apart(after.unevenness), *s.unevenness),
        exponents=_jittered(after, few, settings, random),
        log_weights=np.where(few, -np.log(n), belief.log_weights),
    )


def _jittered(belief: Belief, few: Mask, settings: FilterSettings, random: np.random.Generator) -> Array:
    """Return the exponents of the stress (n, 8, 3), those of the components `few` (8,) a little apart."""
    if belief.prior.reference is None:
        return belief.exponents
    low, high = np.array(belief.prior.settings.exponents).T
    shift = settings.exponent_jitter * (high - low)
    shift = shift * in_common(random.standard_normal(belief.exponents.shape))
    return np.where(few[:, np.newaxis], np.clip(belief.exponents + shift, low, high), belief.exponents)
