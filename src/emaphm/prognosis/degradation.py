"""Degradation of a unit's components from its diagnoses: a Rao-Blackwellised particle filter.

A particle holds a law with its parameters for each component, and one Kalman filter for the levels and rates
of all components together: given the laws they are linear-Gaussian, and so is a diagnosis, whose full
covariance is taken. All particles' filters advance together, as arrays.

Each component has weights of its own, from the likelihood of its own estimate, and is resampled on its own: a
block particle filter [3]. A whole unit's particle would have to be right in eight laws at once, which needs
many times as many. This is exact where the estimates of a diagnosis are uncorrelated. Where they are
correlated, levels and rates take all of the covariance, and only the choice between laws does without what
the others' errors say.

References
----------
[1] Doucet, de Freitas, Murphy, Russell: Rao-Blackwellised particle filtering for dynamic Bayesian networks,
    Conference on Uncertainty in Artificial Intelligence (2000).
[2] Liu, West: Combined parameter and state estimation in simulation-based filtering, in: Sequential Monte
    Carlo Methods in Practice (2001).
[3] Rebeschini, van Handel: Can local particle filters beat the curse of dimensionality?, Annals of Applied
    Probability 25 (2015).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.prognosis.laws import Mask, Numbers, noises, transition
from emaphm.prognosis.prior import COMPONENTS, NEW, Hypotheses, Prior, is_moving, is_waiting
from emaphm.prognosis.settings import EXPONENTIAL, FILTER, POWER_LAW, FilterSettings
from emaphm.random_streams import stream

ROUNDING = 1e-9
"""Share of a rate's variance below which what the level leaves of it is a rounding error."""


LARGEST_LEVEL = 3.0
"""Mean and standard deviation of a level that are told apart from larger ones: levels are in [-1, 1]."""

LARGEST_RATE = 0.05
"""Of a rate [1/h]: a component that is worn out within a day."""

LEAST_VARIANCE = 1e-12
"""Of a level: what rounding may leave of it is no smaller, nor negative."""


@dataclass(frozen=True, eq=False)
class Belief:
    """What is believed of a unit at flight `hours` [h]: n particles of 8 components (`CARTESIAN_NAMES`).

    Attributes
    ----------
    born
        Flight hours [h] at which each component was new, shape (8,).
    law, life_scale, shape, roughness
        Of each particle and component, (n, 8): as in `Hypotheses`.
    level, rate
        Means of the Kalman filters, (n, 8); [-], [1/h].
    levels, mixed, rates
        Their covariances, (n, 8, 8): of the levels; of levels (rows) and rates (columns); of the rates.
    log_weights
        Natural logarithms of the particles' weights for each component, (n, 8); the exponentials of a column
        sum to 1.
    seed, steps
        Source of all randomness, and how many steps have drawn from it.
    """

    hours: float
    born: Array
    law: Numbers
    life_scale: Array
    shape: Array
    roughness: Array
    level: Array
    rate: Array
    levels: Array
    mixed: Array
    rates: Array
    log_weights: Array
    prior: Prior
    seed: int
    steps: int = 0

    @classmethod
    def new(cls, prior: Prior, *, seed: int = 0, settings: FilterSettings = FILTER) -> "Belief":
        """Return what is believed of a new unit, at 0 h."""
        n = settings.particles
        drawn = prior.draw(n, stream(seed, "degradation", "new"))
        zero = np.zeros((n, COMPONENTS, COMPONENTS))
        return cls(
            hours=0.0,
            born=np.zeros(COMPONENTS),
            law=drawn.law,
            life_scale=drawn.life_scale,
            shape=drawn.shape,
            roughness=drawn.roughness,
            level=np.tile(NEW, (n, 1)),
            rate=drawn.rate,
            levels=zero + prior.settings.new_level**2 * np.eye(COMPONENTS),
            mixed=zero,
            rates=drawn.rate_deviation[:, :, np.newaxis] ** 2 * np.eye(COMPONENTS),
            log_weights=np.full((n, COMPONENTS), -np.log(n)),
            prior=prior,
            seed=seed,
        )

    @property
    def weights(self) -> Array:
        """Weights of the particles for each component, (n, 8); columns sum to 1."""
        return np.asarray(np.exp(self.log_weights))

    @property
    def effective_number(self) -> Array:
        """1 / Σ w² of each component, (8,), between 1 and n."""
        return np.asarray(1 / np.sum(self.weights**2, axis=0))

    @property
    def mean_level(self) -> Array:
        """Mean level of each component, (8,)."""
        return np.asarray(np.sum(self.weights * self.level, axis=0))

    @property
    def mean_rate(self) -> Array:
        """Mean rate of each component [1/h], (8,)."""
        return np.asarray(np.sum(self.weights * self.rate, axis=0))

    def hypotheses(self) -> Hypotheses:
        """Return the particles' hypotheses, with the present rates, each array (n, 8)."""
        deviation = np.sqrt(np.maximum(np.einsum("nii->ni", self.rates), 0.0))
        return Hypotheses(self.law, self.life_scale, self.shape, self.roughness, self.rate, deviation)

    def law_probabilities(self) -> Array:
        """Return the probability of each law for each component, (8, laws)."""
        count = len(self.prior.settings.laws)
        return np.stack(
            [(self.weights * (self.law == number)).sum(axis=0) for number in range(count)], axis=1
        )


def predicted(belief: Belief, hours: float) -> Belief:
    """Return the belief at later flight `hours` [h]: onsets and changes of law are drawn, the rest follows.

    A component of sudden onset sets in with probability 1 - exp(-h/T) in h hours, at a moment of which each
    is equally likely; any component takes up another law with probability 1 - exp(-h/`change_hours`).
    """
    step = hours - belief.hours
    if step <= 0:
        return belief
    belief = _changed(belief, step)
    random = stream(belief.seed, "degradation", belief.steps, "onset")
    s = belief.prior.settings
    sets_in = is_waiting(belief.law) & (
        random.random(belief.law.shape) < -np.expm1(-step / belief.life_scale)
    )
    reach, growth = transition(
        belief.law, belief.life_scale, belief.shape, belief.hours - belief.born, step, s
    )
    reach = np.where(is_waiting(belief.law), 0.0, reach)
    if sets_in.any():
        belief = _with_hypotheses(belief, sets_in, belief.prior.after_onset(belief.law.shape, random))
        reach = np.where(sets_in, step * random.random(reach.shape), reach)
    # x⁺ = x + d v, v⁺ = g v: F = [[I, diag d], [0, diag g]], so that P⁺ = F P Fᵀ + Q needs no matrix product.
    across = belief.mixed * reach[:, np.newaxis, :]
    levels = belief.levels + across + np.swapaxes(across, 1, 2)
    levels += belief.rates * reach[:, :, np.newaxis] * reach[:, np.newaxis, :]
    mixed = (belief.mixed + belief.rates * reach[:, :, np.newaxis]) * growth[:, np.newaxis, :]
    rates = belief.rates * growth[:, :, np.newaxis] * growth[:, np.newaxis, :]
    for part, variance in zip(
        (levels, mixed, rates), noises(belief.law, belief.life_scale, belief.roughness, step, s), strict=True
    ):
        np.einsum("nii->ni", part)[...] += variance
    after = replace(
        belief,
        hours=hours,
        level=np.clip(belief.level + reach * belief.rate, -LARGEST_LEVEL, LARGEST_LEVEL),
        rate=np.clip(growth * belief.rate, -LARGEST_RATE, LARGEST_RATE),
        levels=levels,
        mixed=mixed,
        rates=rates,
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
    total = belief.levels + covariance
    variance = np.einsum("nii->ni", total)
    sides = np.concatenate([innovation[:, :, np.newaxis], belief.levels, belief.mixed], axis=2)
    solved = np.linalg.solve(total, sides)
    seen, of_levels, of_mixed = (
        solved[:, :, :1],
        solved[:, :, 1 : 1 + COMPONENTS],
        solved[:, :, 1 + COMPONENTS :],
    )
    to_rates = np.swapaxes(belief.mixed, 1, 2)
    levels = belief.levels - belief.levels @ of_levels
    rates = belief.rates - to_rates @ of_mixed
    for part, least in ((levels, LEAST_VARIANCE), (rates, 0.0)):
        diagonal = np.einsum("nii->ni", part)
        diagonal[...] = np.maximum(diagonal, least)
    log_weights = belief.log_weights - 0.5 * (innovation**2 / variance + np.log(variance))
    log_weights -= log_weights.max(axis=0)
    log_weights -= np.log(np.exp(log_weights).sum(axis=0))
    after = replace(
        belief,
        level=belief.level + (belief.levels @ seen)[:, :, 0],
        rate=belief.rate + (to_rates @ seen)[:, :, 0],
        # Kept symmetric: what rounding leaves would grow with the rates of an exponential law.
        levels=(levels + np.swapaxes(levels, 1, 2)) / 2,
        mixed=belief.mixed - belief.levels @ of_mixed,
        rates=(rates + np.swapaxes(rates, 1, 2)) / 2,
        log_weights=log_weights,
        steps=belief.steps + 1,
    )
    few = after.effective_number < settings.effective_share * len(log_weights)
    return _resampled(after, few, settings) if few.any() else after


def replaced(belief: Belief, components: Mask) -> Belief:
    """Return the belief after the replacement of `components`, (8,) of True and False, at its hours."""
    n = len(belief.law)
    random = stream(belief.seed, "degradation", belief.steps, "replacement")
    where = np.broadcast_to(components, (n, COMPONENTS))
    after = _with_hypotheses(belief, where, belief.prior.draw(n, random))
    levels, mixed = after.levels.copy(), after.mixed.copy()
    levels[:, components, :] = levels[:, :, components] = 0.0
    mixed[:, components, :] = 0.0
    own = np.flatnonzero(components)
    levels[:, own, own] = belief.prior.settings.new_level**2
    return replace(
        after,
        born=np.where(components, belief.hours, belief.born),
        level=np.where(components, NEW, belief.level),
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
    if of_level.max() <= LARGEST_LEVEL and of_rate.max() <= LARGEST_RATE:
        return belief
    a, s = (
        LARGEST_LEVEL / np.maximum(of_level, LARGEST_LEVEL),
        LARGEST_RATE / np.maximum(of_rate, LARGEST_RATE),
    )
    return replace(
        belief,
        levels=belief.levels * a[:, :, np.newaxis] * a[:, np.newaxis, :],
        mixed=belief.mixed * a[:, :, np.newaxis] * s[:, np.newaxis, :],
        rates=belief.rates * s[:, :, np.newaxis] * s[:, np.newaxis, :],
    )


def _changed(belief: Belief, step: float) -> Belief:
    """Return the belief with the laws that change within `step` [h] drawn anew.

    What moves on keeps its rate, since only the law is another; what begins to move has a new one.
    """
    random = stream(belief.seed, "degradation", belief.steps, "change")
    s = belief.prior.settings
    changes = random.random(belief.law.shape) < -np.expm1(-step / s.change_hours)
    if not changes.any():
        return belief
    age = np.broadcast_to(belief.hours - belief.born, belief.law.shape)
    drawn = belief.prior.general(belief.law.shape, age, random)
    goes_on = changes & is_moving(belief.law) & is_moving(drawn.law)
    after = _with_hypotheses(belief, changes & ~goes_on, drawn)
    return replace(
        after,
        law=np.where(goes_on, drawn.law, after.law),
        life_scale=np.where(goes_on, drawn.life_scale, after.life_scale),
        shape=np.where(goes_on, drawn.shape, after.shape),
        roughness=np.where(goes_on, drawn.roughness, after.roughness),
    )


def _with_hypotheses(belief: Belief, where: Mask, drawn: Hypotheses) -> Belief:
    """Return the belief with other hypotheses and rates `where` (n, 8) is True."""
    mixed, rates = belief.mixed.copy(), belief.rates.copy()
    mixed[np.broadcast_to(where[:, np.newaxis, :], mixed.shape)] = 0.0
    rates[where[:, np.newaxis, :] | where[:, :, np.newaxis]] = 0.0
    np.einsum("nii->ni", rates)[where] = drawn.rate_deviation[where] ** 2
    return replace(
        belief,
        law=np.where(where, drawn.law, belief.law),
        life_scale=np.where(where, drawn.life_scale, belief.life_scale),
        shape=np.where(where, drawn.shape, belief.shape),
        roughness=np.where(where, drawn.roughness, belief.roughness),
        rate=np.where(where, drawn.rate, belief.rate),
        mixed=mixed,
        rates=rates,
    )


def _resampled(belief: Belief, few: Mask, settings: FilterSettings) -> Belief:
    """Return a belief whose components `few` (8,) are resampled, and their copies differ a little."""
    random = stream(belief.seed, "degradation", belief.steps, "resampling")
    n = len(belief.law)
    rows = drawn_rows(belief, n, random)
    rows[:, ~few] = np.arange(n)[:, np.newaxis]
    after = recombined(belief, rows)
    s = belief.prior.settings
    factors = np.where(few, np.exp(settings.jitter * random.standard_normal((3, n, COMPONENTS))), 1.0)
    shape = after.shape * factors[1]
    shape = np.where(after.law == EXPONENTIAL, np.clip(shape, *s.growth), shape)
    shape = np.where(after.law == POWER_LAW, np.clip(shape, *s.exponent), shape)
    return replace(
        after,
        life_scale=np.clip(after.life_scale * factors[0], *s.life_scale),
        shape=shape,
        roughness=np.clip(after.roughness * factors[2], *s.roughness),
        log_weights=np.where(few, -np.log(n), belief.log_weights),
    )


def drawn_rows(belief: Belief, count: int, random: np.random.Generator) -> NDArray[np.intp]:
    """Return rows of the particles for each component, (count, 8), drawn by its weights, in any order."""
    columns = [random.permutation(systematic(one, count, random)) for one in belief.weights.T]
    return np.stack(columns, axis=1)


def recombined(belief: Belief, rows: NDArray[np.intp]) -> Belief:
    """Return the belief with component c of particle i taken from particle `rows`[i, c], equally weighted.

    A component brings the means and the covariance of its level and rate. How components are correlated is
    that of all particles, by their weights: covariances are averaged between x/σ_x and the part of v that x
    does not say, (v - k x)/σ_v|x, k = cov(v, x)/σ_x², so that the new ones are positive definite too.
    """
    a, k, s = _own(belief)
    inverse_a, inverse_s = 1 / a, np.divide(1.0, s, out=np.zeros_like(s), where=s > 0)
    w = belief.weights.mean(axis=1)
    k_rows, k_columns = k[:, :, np.newaxis], k[:, np.newaxis, :]
    back = np.swapaxes(belief.mixed, 1, 2)
    of_v = belief.rates - k_rows * belief.mixed - back * k_columns + k_rows * k_columns * belief.levels
    levels = _mean_product(w, belief.levels, inverse_a, inverse_a)
    mixed = _mean_product(w, belief.mixed - belief.levels * k_columns, inverse_a, inverse_s)
    rates = _mean_product(w, of_v, inverse_s, inverse_s)
    np.fill_diagonal(levels, 1.0)
    np.fill_diagonal(mixed, 0.0)
    np.fill_diagonal(rates, 1.0)
    columns = np.arange(COMPONENTS)
    a, k, s = a[rows, columns], k[rows, columns], s[rows, columns]
    k_rows, k_columns = k[:, :, np.newaxis], k[:, np.newaxis, :]
    new_levels = levels * a[:, :, np.newaxis] * a[:, np.newaxis, :]
    new_mixed = mixed * a[:, :, np.newaxis] * s[:, np.newaxis, :] + new_levels * k_columns
    new_rates = rates * s[:, :, np.newaxis] * s[:, np.newaxis, :] + k_rows * new_mixed
    new_rates += np.swapaxes(new_mixed, 1, 2) * k_columns - k_rows * k_columns * new_levels
    return replace(
        belief,
        law=belief.law[rows, columns],
        life_scale=belief.life_scale[rows, columns],
        shape=belief.shape[rows, columns],
        roughness=belief.roughness[rows, columns],
        level=belief.level[rows, columns],
        rate=belief.rate[rows, columns],
        levels=new_levels,
        mixed=new_mixed,
        rates=new_rates,
        log_weights=np.full(rows.shape, -np.log(len(rows))),
    )


def _own(belief: Belief) -> tuple[Array, Array, Array]:
    """Return σ_x, k and σ_v|x of each particle's components, (n, 8) each, as in `recombined`."""
    variance = np.maximum(np.einsum("nii->ni", belief.levels), LEAST_VARIANCE)
    k = np.einsum("nii->ni", belief.mixed) / variance
    of_rate = np.einsum("nii->ni", belief.rates)
    rest = of_rate - k**2 * variance
    return np.sqrt(variance), k, np.sqrt(np.where(rest > ROUNDING * of_rate, rest, 0.0))


def _mean_product(weights: Array, values: Array, left: Array, right: Array) -> Array:
    """Return the weighted mean of diag(left) values diag(right), (8, 8)."""
    return np.asarray(np.einsum("n,nij,ni,nj->ij", weights, values, left, right, optimize=True))


def systematic(weights: Array, count: int, random: np.random.Generator) -> NDArray[np.intp]:
    """Return `count` indices of `weights` (n,), each as often as its weight asks, to one more or less."""
    places = (np.arange(count) + random.random()) / count * np.sum(weights)
    return np.minimum(np.searchsorted(np.cumsum(weights), places), len(weights) - 1)
