"""What an estimator answers: a mixture of normal distributions of the coordinates of a recording.

One normal distribution holds what the channels constrain; several hold what may be one thing or another, as
an eccentricity and a short that look alike.
"""

from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.space.parameter_space import ParameterSpace


@dataclass(frozen=True, eq=False)
class Mixture:
    """`weights` (m,), `means` (m, d) and `factors` (m, d, d): Σ_j = factor_j factor_jᵀ, lower triangular."""

    weights: Array
    means: Array
    factors: Array

    @property
    def mean(self) -> Array:
        """The mean, (d,)."""
        return np.asarray(self.weights @ self.means)

    @property
    def covariance(self) -> Array:
        """The covariance, (d, d): those of the components, and of their means about the mean."""
        within = np.einsum("m,mij,mkj->ik", self.weights, self.factors, self.factors)
        apart = self.means - self.mean
        return np.asarray(within + np.einsum("m,mi,mj->ij", self.weights, apart, apart))

    def starts(self, least_weight: float, separation: float) -> Array:
        """Return the mean, and the means of components that say something else.

        Those of at least `least_weight` that are farther from the mean than `separation` of their own
        standard deviations (Mahalanobis).
        """
        apart = np.linalg.solve(self.factors, (self.means - self.mean)[..., np.newaxis])[..., 0]
        other = (self.weights >= least_weight) & (np.linalg.norm(apart, axis=1) > separation)
        return np.vstack([self.mean[np.newaxis], self.means[other]])

    def sample(self, count: int, rng: np.random.Generator) -> Array:
        """Return `count` points (count, d)."""
        which = rng.choice(len(self.weights), count, p=self.weights / self.weights.sum())
        normal = rng.normal(size=(count, self.means.shape[1]))
        return np.asarray(self.means[which] + np.einsum("nij,nj->ni", self.factors[which], normal))

    def inside(self, space: ParameterSpace, count: int, rng: np.random.Generator) -> Array:
        """Return `count` points of those within the bounds of `space`, or moved into them where few are."""
        drawn = self.sample(4 * count, rng)
        moved = space.project(drawn)
        kept = drawn[np.all(np.abs(moved - drawn) < 1e-12, axis=1)]
        return np.asarray(kept[:count] if len(kept) >= count else np.vstack([kept, moved])[:count])

    def scaled(self, factors: Array) -> "Mixture":
        """Return the mixture with standard deviations `factors` (d,) times as large, about the same means."""
        return Mixture(self.weights, self.means, self.factors * factors[:, np.newaxis])
