"""How probable faults are in the light of a recording: the density that walkers sample.

Before the recording, the faults are spread evenly over their box and the eccentricity over its disk; the
nuisances have their normal priors. The likelihood is a normal one. White residuals would make it far too
sure: those of a good fit are correlated over milliseconds (see `emaphm.estimation.covariance`). Its
covariance of the residual is therefore one under which least squares are efficient (Kruskal 1968), and
know exactly what the estimate's own covariance C (d, d) says that they know (Müller 2013: the sandwich as
the posterior's covariance). With r the residual, G (d, rows) the derivatives at the estimate, I = G Gᵀ, and
W = C⁻¹ less the precision of the priors in it,

    log L = -½ Δᵀ W Δ - ½ ω |r - GᵀΔ|²,    Δ = I⁻¹ G r,    ω = tr(W C) / tr(I C),

in which Δ is the Gauss-Newton step that r still asks for. What no step can take away counts by ω, the mean
of W against I: a power of the likelihood (Pauli et al. 2011, Ribatet et al. 2012). Were the residual white of
variance s², this would be -½ |r|² / s². Where the model is linear the last part is constant, and the
posterior is normal with covariance C, cut by the bounds.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.estimation.levenberg_marquardt import information
from emaphm.estimation.local_covariance import slopes
from emaphm.estimation.objective import Fit
from emaphm.estimation.parameter_space import FaultSpace


@dataclass(eq=False)
class Density:
    """The logarithm of the posterior density, up to a constant; see the top of this file.

    `correction` (rows,) is added to the outputs of `fit`. Of the estimate are `derivatives` (d, rows), their
    `normal` matrix G Gᵀ (d, d), the `inverse` (d, d) of I, that without the noise of the derivatives, the
    `information` W (d, d) that the recording adds to the priors, and the `weight` ω of what no step explains.
    `evaluations` counts the runs of the model.
    """

    fit: Fit
    correction: Array
    derivatives: Array
    normal: Array
    inverse: Array
    information: Array
    weight: float
    evaluations: int

    @classmethod
    def of(cls, fit: Fit, point: Array, correction: Array, covariance: Array, seed: int) -> Self:
        """Return the density whose curvature at `point` (d,) is what `covariance` (d, d) says."""
        rows = fit.recorded_rows
        several, spent = slopes(fit, point, seed)
        derivatives = several.mean(axis=0)
        fisher = information(several)
        inverse = np.asarray(np.linalg.pinv(fisher, rcond=1e-9, hermitian=True), float)
        # The covariance allows for a normal prior of every coordinate: what is left is the recording's.
        known = np.linalg.inv(covariance) - np.diag(fit.space.prior_deviations**-2)
        values, axes = np.linalg.eigh((known + known.T) / 2)
        told = axes * np.maximum(values, 0.0) @ axes.T
        # Where nothing moves anything, nothing is told either.
        least = np.finfo(float).tiny
        weight = float(np.trace(told @ covariance) / max(float(np.trace(fisher @ covariance)), least))
        normal = derivatives @ derivatives.T
        return cls(fit, correction[:rows], derivatives, normal, inverse, told, weight, spent)

    def __call__(self, points: Array) -> Array:
        """Return the log density at `points` (n, d), shape (n,); -inf outside of the bounds."""
        density = np.full(len(points), -np.inf)
        inside = np.flatnonzero(allowed(self.fit.space, points))
        if inside.size:
            self.evaluations += inside.size
            density[inside] = self._inside(points[inside])
        return density

    def _inside(self, points: Array) -> Array:
        rows = self.fit.recorded_rows
        residuals = self.fit.target[:rows] - self.correction - self.fit.outputs(points)[:, :rows]
        # So small a product is faster without the threads that a matrix product would start each time.
        along = np.einsum("nr,dr->nd", residuals, self.derivatives)
        steps = along @ self.inverse
        # |r - GᵀΔ|² in terms of Gr, which spares the product GᵀΔ.
        left = np.einsum("nr,nr->n", residuals, residuals) + forms(steps, self.normal)
        left -= 2 * np.sum(steps * along, axis=1)
        space = self.fit.space
        prior = np.sum((points[:, len(space.columns) :] / space.nuisances.priors) ** 2, axis=1)
        told = forms(steps, self.information)
        return np.asarray(-(told + self.weight * left + prior) / 2)


def forms(vectors: Array, matrix: Array) -> Array:
    """Return the quadratic form of `matrix` (d, d) at each of `vectors` (n, d), shape (n,)."""
    return np.asarray(np.sum((vectors @ matrix) * vectors, axis=1))


def allowed(space: FaultSpace, points: Array) -> NDArray[np.bool_]:
    """Return which of `points` (n, d) are within the bounds, (n,)."""
    return np.asarray(np.all(np.abs(space.project(points) - points) < 1e-12, axis=1))
