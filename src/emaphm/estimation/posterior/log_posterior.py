"""Posterior density of faults and nuisances, given a recording.

The priors of the faults are uniform over their box, that of the eccentricity over its disk; the nuisances
have normal priors. The likelihood is normal. With the assumption of white residuals it would be far too
narrow: the residuals of a good fit are correlated over milliseconds (see
`emaphm.estimation.uncertainty.covariance`). The likelihood therefore has a covariance of the residual under
which least squares are efficient (Kruskal 1968) and have the covariance C (d, d) of the estimate (Müller
2013: the sandwich as the posterior's covariance). With the residual r, the derivatives G (d, rows) at the
estimate, I = G Gᵀ, and W = C⁻¹ minus the precision of the priors in it,

    log L = -½ Δᵀ W Δ - ½ ω |r - GᵀΔ|²,    Δ = I⁻¹ G r,    ω = tr(W C) / tr(I C),

in which Δ is the remaining Gauss-Newton step for r. The part of r that no step can remove has the weight ω,
the mean of W relative to I: a power of the likelihood (Pauli et al. 2011, Ribatet et al. 2012). For a white
residual of variance s², the sum would be -½ |r|² / s². For a linear model the last part is constant, and the
posterior is normal with covariance C, truncated by the bounds.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.estimation.uncertainty.fisher_information import information
from emaphm.estimation.uncertainty.local_covariance import jacobians_at


@dataclass(frozen=True, eq=False)
class LogPosterior:
    """Logarithm of the posterior density, up to a constant; the module's docstring gives the equation.

    Attributes
    ----------
    objective, correction
        The objective, and the correction (rows,) that is added to its outputs.
    derivatives, normal
        G (d, rows) at the estimate, and G Gᵀ (d, d).
    inverse
        I⁻¹ (d, d), where I does not contain the errors of the derivatives.
    information, weight
        W (d, d), the information that the recording adds to the priors, and ω.
    """

    objective: MapObjective
    correction: Array
    derivatives: Array
    normal: Array
    inverse: Array
    information: Array
    weight: float

    @classmethod
    def of(
        cls,
        objective: MapObjective,
        point: Array,
        correction: Array,
        covariance: Array,
        rng: np.random.Generator,
    ) -> Self:
        """Return the density whose curvature at `point` (d,) is the inverse of `covariance` (d, d)."""
        jacobians = jacobians_at(objective, point, rng)
        derivatives = jacobians.mean(axis=0)
        fisher = information(jacobians)
        inverse = np.asarray(np.linalg.pinv(fisher, rcond=1e-9, hermitian=True), float)
        # The covariance includes a normal prior of every coordinate; the rest comes from the recording.
        added = np.linalg.inv(covariance) - np.diag(objective.space.prior_deviations**-2)
        values, axes = np.linalg.eigh((added + added.T) / 2)
        added = axes * np.maximum(values, 0.0) @ axes.T
        # For parameters without any effect, information and weight are 0.
        scale = max(float(np.trace(fisher @ covariance)), np.finfo(float).tiny)
        weight = float(np.trace(added @ covariance)) / scale
        normal = derivatives @ derivatives.T
        rows = objective.channel_rows
        return cls(objective, correction[:rows], derivatives, normal, inverse, added, weight)

    def __call__(self, points: Array) -> Array:
        """Return the log density at `points` (n, d), shape (n,); -inf outside of the bounds."""
        density = np.full(len(points), -np.inf)
        inside = np.flatnonzero(allowed(self.objective.space, points))
        if inside.size:
            density[inside] = self._inside(points[inside])
        return density

    def _inside(self, points: Array) -> Array:
        """Return the log density at `points` (n, d) within the bounds, (n,)."""
        objective, rows = self.objective, self.objective.channel_rows
        residuals = objective.target[:rows] - self.correction - objective.outputs(points)[:, :rows]
        # For this small product, `einsum` is faster than a matrix product, which starts threads each time.
        gradients = np.einsum("nr,dr->nd", residuals, self.derivatives)
        steps = gradients @ self.inverse
        # |r - GᵀΔ|² in terms of Gr, without the product GᵀΔ.
        rest = np.einsum("nr,nr->n", residuals, residuals) + forms(steps, self.normal)
        rest -= 2 * np.sum(steps * gradients, axis=1)
        space = objective.space
        prior = np.sum((points[:, len(space.columns) :] / space.nuisances.priors) ** 2, axis=1)
        return np.asarray(-(forms(steps, self.information) + self.weight * rest + prior) / 2)


def forms(vectors: Array, matrix: Array) -> Array:
    """Return the quadratic form of `matrix` (d, d) at each of `vectors` (n, d), shape (n,)."""
    return np.asarray(np.sum((vectors @ matrix) * vectors, axis=1))


def allowed(space: ParameterSpace, points: Array) -> NDArray[np.bool_]:
    """Return whether each of `points` (n, d) is within the bounds, (n,)."""
    return np.asarray(np.all(np.abs(space.project(points) - points) < 1e-12, axis=1))
