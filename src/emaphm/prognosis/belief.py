"""State of the degradation filter of a unit: particles, each with a Kalman filter."""

from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.prognosis.bounds import COORDINATES
from emaphm.prognosis.laws import Numbers
from emaphm.prognosis.prior import NEW, Hypotheses, Prior
from emaphm.prognosis.settings import FILTER, LAWS, FilterSettings
from emaphm.random_streams import stream

LEAST_VARIANCE = 1e-12
"""Smallest variance of a level: rounding may make a computed variance smaller, or negative."""


@dataclass(frozen=True, eq=False)
class Belief:
    """State of the filter at flight `hours` [h] of a unit: n particles of 8 components (`CARTESIAN_NAMES`).

    An indicator has one component instead of 8.

    The levels are those that diagnoses measure. If the unit's parameters differ from its description, all
    diagnoses have the same error, which more diagnoses do not reduce: the covariance of a true level is that
    of the filters plus `shared`. The diagnoses of a new unit and of an unchanged unit have the same error.

    Attributes
    ----------
    new_at
        Flight hours [h] at which each component was new, shape (8,).
    aged
        Hours [h] at the reference stress that each component has aged since it was new, (n, 8).
    law, life_scale, shape, roughness, unevenness
        Hypothesis of each particle and component, (n, 8), as in `Hypotheses`.
    exponents
        Exponents of the stress, (n, 8, 3), as in `Hypotheses`.
    level, rate
        Means of the Kalman filters, (n, 8); [-], [1/h].
    levels, mixed, rates
        Their covariances, (n, 8, 8): of the levels; of levels (rows) and rates (columns); of the rates.
    age_and_level
        Covariance of each component's ageing and level since the last update, (n, 8) [h].
    log_weights
        Natural logarithms of the particles' weights for each component, (n, 8); the exponentials of a column
        sum to 1.
    log_likelihood
        Log-likelihood of all diagnoses so far, for each component, (8,), except for a constant that is the
        same for all priors.
    surprise
        Probability that the last diagnosis of each component was an outlier or followed a jump, (8,); 0 for a
        component that was replaced since.
    shared
        Covariance of the error that all diagnoses of the unit have in common, (8, 8).
    seed, steps
        Seed of the random streams; number of steps that have drawn from them.
    """

    hours: float
    new_at: Array
    aged: Array
    law: Numbers
    life_scale: Array
    shape: Array
    roughness: Array
    unevenness: Array
    exponents: Array
    level: Array
    rate: Array
    levels: Array
    mixed: Array
    rates: Array
    age_and_level: Array
    log_weights: Array
    log_likelihood: Array
    surprise: Array
    shared: Array
    prior: Prior
    seed: int
    steps: int = 0

    @classmethod
    def new(
        cls,
        prior: Prior,
        *,
        seed: int = 0,
        settings: FilterSettings = FILTER,
        components: int = COORDINATES,
        shared: Array | float = 0.0,
    ) -> "Belief":
        """Return the filter state of the first `components` of a new unit, at 0 h."""
        n = settings.particles
        shared = np.zeros((components, components)) + shared
        drawn = prior.draw(n, stream(seed, "degradation", "new"), components)
        zero = np.zeros((n, components, components))
        return cls(
            hours=0.0,
            new_at=np.zeros(components),
            aged=np.zeros((n, components)),
            law=drawn.law,
            life_scale=drawn.life_scale,
            shape=drawn.shape,
            roughness=drawn.roughness,
            unevenness=drawn.unevenness,
            exponents=drawn.exponents,
            level=np.tile(NEW[:components], (n, 1)),
            rate=drawn.rate,
            levels=zero + prior.settings.new_level**2 * np.eye(components) + shared,
            mixed=zero,
            rates=drawn.rate_deviation[:, :, np.newaxis] ** 2 * np.eye(components),
            age_and_level=np.zeros((n, components)),
            log_weights=np.full((n, components), -np.log(n)),
            log_likelihood=np.zeros(components),
            surprise=np.zeros(components),
            shared=shared,
            prior=prior,
            seed=seed,
        )

    @property
    def age(self) -> float:
        """Flight hours since the oldest component was new [h]."""
        return self.hours - float(self.new_at.min())

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

    def hypotheses(self) -> Hypotheses:
        """Return the particles' hypotheses, with the present rates, each array (n, 8)."""
        deviation = np.sqrt(np.maximum(np.einsum("nii->ni", self.rates), 0.0))
        return Hypotheses(
            law=self.law,
            life_scale=self.life_scale,
            shape=self.shape,
            roughness=self.roughness,
            unevenness=self.unevenness,
            rate=self.rate,
            rate_deviation=deviation,
            exponents=self.exponents,
        )

    def law_probabilities(self) -> Array:
        """Return the probability of each law for each component, (8, laws)."""
        count = len(LAWS)
        return np.stack(
            [(self.weights * (self.law == number)).sum(axis=0) for number in range(count)], axis=1
        )
