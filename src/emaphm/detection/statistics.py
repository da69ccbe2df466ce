"""Statistics T² and Q of a feature vector relative to the healthy scatter, and contributions to them."""

from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.optional_library import import_library

LEAST_SCALE = 1e-6
"""Assumed standard deviation of a feature without variation, so that any change of it is detected."""


@dataclass(frozen=True, eq=False)
class HealthyScatter:
    """Principal directions of healthy features, from a shrunk covariance, for which few cycles suffice.

    With z = x / s, whose shrunk covariance [1] has the directions v_i and the variances λ_i in falling order,

        T² = Σ_{i ≤ k} (v_i·z)² / λ_i,   Q = Σ_{i > k} (v_i·z)²:

    the Mahalanobis distance in the k directions in which healthy cycles differ, and the squared distance
    from those [2].

    Attributes
    ----------
    scale
        s, healthy standard deviations, (p,), in the features' unit.
    directions, variances
        v as columns, (p, p), and λ, (p,), of z.
    rank
        k.

    References
    ----------
    [1] Ledoit, Wolf: A well-conditioned estimator for large-dimensional covariance matrices, 2004.
    [2] Qin: Statistical process monitoring: basics and beyond, J. Chemometrics 17, 2003.
    """

    scale: Array
    directions: Array
    variances: Array
    rank: int

    @classmethod
    def learn(cls, deviations: Array, variance_share: float) -> "HealthyScatter":
        """Return the scatter of healthy `deviations` from their mean, (n, p), by `of`.

        Raises
        ------
        MethodError
            scikit-learn is not installed.
        """
        return cls.of(*shrunk_correlations(deviations), variance_share)

    @classmethod
    def of(cls, scale: Array, correlations: Array, variance_share: float) -> "HealthyScatter":
        """Return the scatter of features with the standard deviations `scale` (p,) and `correlations` (p, p).

        `rank` is the least number of directions with `variance_share` of the variance, so that at least one
        direction remains for Q.
        """
        variances, directions = np.linalg.eigh(correlations)
        variances, directions = variances[::-1].copy(), np.ascontiguousarray(directions[:, ::-1])
        share = np.cumsum(variances) / variances.sum()
        rank = min(int(np.searchsorted(share, variance_share)) + 1, max(variances.size - 1, 1))
        return cls(scale, directions, variances, rank)

    def t2(self, deviations: Array) -> Array:
        """Return T² of `deviations` (n, p): (n,)."""
        return np.asarray(self.t2_contributions(deviations).sum(axis=-1))

    def q(self, deviations: Array) -> Array:
        """Return Q of `deviations` (n, p): (n,)."""
        return np.asarray(self.q_contributions(deviations).sum(axis=-1))

    def t2_contributions(self, deviations: Array) -> Array:
        """Return the contribution of each feature to T², (n, p), not negative.

        It is the squared entry of V Λ^(-1/2) Vᵀ z, with the first k directions V and their variances Λ.
        """
        first = slice(0, self.rank)
        projected = (deviations / self.scale) @ self.directions[:, first] / np.sqrt(self.variances[first])
        return np.asarray((projected @ self.directions[:, first].T) ** 2)

    def q_contributions(self, deviations: Array) -> Array:
        """Return the contribution of each feature to Q, (n, p), not negative.

        It is the squared entry of z projected on the other directions.
        """
        others = self.directions[:, self.rank :]
        return np.asarray(((deviations / self.scale) @ others @ others.T) ** 2)

    def whitened(self, deviations: Array) -> Array:
        """Return V Λ^(-1/2) Vᵀ z over all directions, (n, p), whose healthy covariance is the identity."""
        projected = (deviations / self.scale) @ self.directions / np.sqrt(self.variances)
        return np.asarray(projected @ self.directions.T)


def shrunk_correlations(deviations: Array) -> tuple[Array, Array]:
    """Return the standard deviations (p,) of `deviations` (n, p) and their shrunk correlations (p, p).

    A feature that does not vary has the standard deviation `LEAST_SCALE`.

    Raises
    ------
    MethodError
        scikit-learn is not installed.
    """
    scale = np.maximum(np.sqrt(np.mean(deviations**2, axis=0)), LEAST_SCALE)
    estimators = import_library("learning a detector", "sklearn.covariance", "detection")
    relative = deviations / scale
    shrinkage = float(estimators.ledoit_wolf_shrinkage(relative, assume_centered=True))
    correlations = relative.T @ relative / len(relative)
    shrunk = (1.0 - shrinkage) * correlations
    shrunk.flat[:: scale.size + 1] += shrinkage * (np.trace(correlations) / scale.size)
    return scale, shrunk
