"""Degradation of a unit's components from its diagnoses: a Rao-Blackwellised particle filter.

A particle holds a law with its parameters for each component, and one Kalman filter for the levels and rates
of all components together: given the laws they are linear-Gaussian, and so is a diagnosis, whose full
covariance is taken. All particles' filters advance together, as arrays.

References
----------
[1] Doucet, de Freitas, Murphy, Russell: Rao-Blackwellised particle filtering for dynamic Bayesian networks,
    Conference on Uncertainty in Artificial Intelligence (2000).
[2] Liu, West: Combined parameter and state estimation in simulation-based filtering, in: Sequential Monte
    Carlo Methods in Practice (2001).
"""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.prognosis.laws import Numbers, noises, transition
from emaphm.prognosis.prior import COMPONENTS, NEW, Hypotheses, Prior, is_moving, is_waiting
from emaphm.prognosis.settings import EXPONENTIAL, FILTER, POWER_LAW, FilterSettings
from emaphm.random_streams import stream


@dataclass(frozen=True, eq=False)
class Belief:
    """What is believed of a unit at flight `hours` [h]: n particles of 8 components (`CARTESIAN_NAMES`).

    Attributes
    ----------
    born
        Flight hours [h] at which each component was new, shape (8,).
    law, life_scale, shape
        Of each particle and component, (n, 8): as in `transition`.
    level, rate
        Means of the Kalman filters, (n, 8); [-], [1/h].
    levels, mixed, rates
        Their covariances, (n, 8, 8): of the levels; of levels (rows) and rates (columns); of the rates.
    log_weights
        Natural logarithms of the particles' weights, (n,); their exponentials sum to 1.
    seed, steps
        Source of all randomness, and how many steps have drawn from it.
    """

    hours: float
    born: Array
    law: Numbers
    life_scale: Array
    shape: Array
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
            level=np.tile(NEW, (n, 1)),
            rate=drawn.rate,
            levels=zero + prior.settings.new_level**2 * np.eye(COMPONENTS),
            mixed=zero,
            rates=drawn.rate_deviation[:, :, np.newaxis] ** 2 * np.eye(COMPONENTS),
            log_weights=np.full(n, -np.log(n)),
            prior=prior,
            seed=seed,
        )

    @property
    def weights(self) -> Array:
        """Weights of the particles, (n,), which sum to 1."""
        return np.exp(self.log_weights)

    @property
    def effective_number(self) -> float:
        """1 / Σ w², between 1 and n."""
        return float(1 / np.sum(self.weights**2))

    def hypotheses(self) -> Hypotheses:
        """Return the particles' hypotheses, with the present rates, each array (n, 8)."""
        deviation = np.sqrt(np.maximum(np.einsum("nii->ni", self.rates), 0.0))
        return Hypotheses(self.law, self.life_scale, self.shape, self.rate, deviation)

    def law_probabilities(self) -> Array:
        """Return the probability of each law for each component, (8, laws)."""
        count = len(self.prior.settings.laws)
        return np.stack([self.weights @ (self.law == number) for number in range(count)], axis=1)


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
        (levels, mixed, rates), noises(belief.law, belief.life_scale, step, s), strict=True
    ):
        np.einsum("nii->ni", part)[...] += variance
    return replace(
        belief,
        hours=hours,
        level=belief.level + reach * belief.rate,
        rate=growth * belief.rate,
        levels=levels,
        mixed=mixed,
        rates=rates,
        steps=belief.steps + 1,
    )


def updated(belief: Belief, estimate: Array, covariance: Array, settings: FilterSettings = FILTER) -> Belief:
    """Return the belief after a diagnosis at its hours; resampled where too few particles carry the weight.

    Parameters
    ----------
    estimate, covariance
        Of the levels, (8,) and (8, 8), in the coordinates `CARTESIAN_NAMES`. A component that was not seen
        has a very large variance.
    """
    innovation = estimate - belief.level
    total = belief.levels + covariance
    sides = np.concatenate([innovation[:, :, np.newaxis], belief.levels, belief.mixed], axis=2)
    solved = np.linalg.solve(total, sides)
    seen, of_levels, of_mixed = (
        solved[:, :, :1],
        solved[:, :, 1 : 1 + COMPONENTS],
        solved[:, :, 1 + COMPONENTS :],
    )
    to_rates = np.swapaxes(belief.mixed, 1, 2)
    levels = belief.levels - belief.levels @ of_levels
    diagonals = np.einsum("nii->ni", np.linalg.cholesky(total))
    log_likelihood = -0.5 * np.einsum("ni,ni->n", innovation, seen[:, :, 0]) - np.log(diagonals).sum(axis=1)
    log_weights = belief.log_weights + log_likelihood
    log_weights -= log_weights.max()
    log_weights -= np.log(np.exp(log_weights).sum())
    after = replace(
        belief,
        level=belief.level + (belief.levels @ seen)[:, :, 0],
        rate=belief.rate + (to_rates @ seen)[:, :, 0],
        levels=(levels + np.swapaxes(levels, 1, 2)) / 2,
        mixed=belief.mixed - belief.levels @ of_mixed,
        rates=belief.rates - to_rates @ of_mixed,
        log_weights=log_weights,
        steps=belief.steps + 1,
    )
    few = after.effective_number < settings.effective_share * len(log_weights)
    return _resampled(after, settings) if few else after


def replaced(belief: Belief, components: Array) -> Belief:
    """Return the belief after the replacement of `components`, (8,) of True and False, at its hours."""
    n = len(belief.log_weights)
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
    )


def _with_hypotheses(belief: Belief, where: Array, drawn: Hypotheses) -> Belief:
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
        rate=np.where(where, drawn.rate, belief.rate),
        mixed=mixed,
        rates=rates,
    )


def _resampled(belief: Belief, settings: FilterSettings) -> Belief:
    """Return equally weighted particles, drawn systematically, whose copies differ a little in parameters."""
    random = stream(belief.seed, "degradation", belief.steps, "resampling")
    n = len(belief.log_weights)
    rows = systematic(belief.weights, n, random)
    s = belief.prior.settings
    factors = np.exp(settings.jitter * random.standard_normal((2, n, COMPONENTS)))
    law, shape = belief.law[rows], belief.shape[rows] * factors[1]
    shape = np.where(law == EXPONENTIAL, np.clip(shape, *s.growth), shape)
    shape = np.where(law == POWER_LAW, np.clip(shape, *s.exponent), shape)
    return replace(
        belief,
        law=law,
        life_scale=np.clip(belief.life_scale[rows] * factors[0], *s.life_scale),
        shape=shape,
        level=belief.level[rows],
        rate=belief.rate[rows],
        levels=belief.levels[rows],
        mixed=belief.mixed[rows],
        rates=belief.rates[rows],
        log_weights=np.full(n, -np.log(n)),
    )


def systematic(weights: Array, count: int, random: np.random.Generator) -> np.ndarray:
    """Return `count` indices of `weights` (n,), each as often as its weight asks, to one more or less."""
    places = (np.arange(count) + random.random()) / count * np.sum(weights)
    return np.minimum(np.searchsorted(np.cumsum(weights), places), len(weights) - 1)
