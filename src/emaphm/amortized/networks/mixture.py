"""Answer of an estimator: the posterior of a recording's coordinates, as a mixture of normal distributions.

One normal distribution describes coordinates that the channels constrain. Several describe alternatives, such
as an eccentricity and a short with similar effects.
"""

from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.space.parameter_space import ParameterSpace


@dataclass(frozen=True, eq=False)
class Mixture:
    """Mixture of m normal distributions.

    `weights` (m,), `means` (m, d) and `factors` (m, d, d), lower triangular: Σ_j = factor_j factor_jᵀ.
    """

    weights: Array
    means: Array
    factors: Array

    @property
    def mean(self) -> Array:
        """The mean, (d,)."""
        return np.asarray(self.weights @ self.means)

    @property
    def covariance(self) -> Array:
        """The covariance, (d, d): that of the components, and that of their means about the mean."""
        within = np.einsum("m,mij,mkj->ik", self.weights, self.factors, self.factors)
        centred = self.means - self.mean
        return np.asarray(within + np.einsum("m,mi,mj->ij", self.weights, centred, centred))

    def starts(self, least_weight: float, separation: float) -> Array:
        """Return the mean, and the means of distant components, (number, d).

        A component is distant if its weight is at least `least_weight`, and the Mahalanobis distance of its
        mean from the mixture's mean, with its own covariance, is above `separation`.
        """
        distances = np.linalg.solve(self.factors, (self.means - self.mean)[..., np.newaxis])[..., 0]
        distant = (self.weights >= least_weight) & (np.linalg.norm(distances, axis=1) > separation)
        return np.vstack([self.mean[np.newaxis], self.means[distant]])

    def sample(self, count: int, rng: np.random.Generator) -> Array:
        """Return `count` random points (count, d)."""
        component = rng.choice(len(self.weights), count, p=self.weights / self.weights.sum())
        normal = rng.normal(size=(count, self.means.shape[1]))
        return np.asarray(self.means[component] + np.einsum("nij,nj->ni", self.factors[component], normal))

    def inside(self, space: ParameterSpace, count: int, rng: np.random.Generator) -> Array:
        """Return `count` random points (count, d) within the bounds of `space`.

        If too few of 4 `count` samples are within the bounds, projected samples are added.
        """
        samples = self.sample(4 * count, rng)
        projected = space.project(samples)
        inside = samples[np.all(np.abs(projected - samples) < 1e-12, axis=1)]
        return np.asarray(inside[:count] if len(inside) >= count else np.vstack([inside, projected])[:count])

    def scaled(self, factors: Array) -> "Mixture":
        """Return the mixture with the same means, and standard deviations multiplied by `factors` (d,)."""
        return Mixture(self.weights, self.means, self.factors * factors[:, np.newaxis])
