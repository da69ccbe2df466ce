"""Linear model of the current's residual about an estimate, with nuisances that were not estimated."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.uncertainty.local_covariance import jacobians_of
from emaphm.random_streams import stream

STEP = 0.02
"""Step of a coordinate for a derivative: a tenth of a standard deviation of the prior."""


@dataclass(frozen=True, eq=False)
class LinearModel:
    """Projection of the current's residual at the estimate `searched` on the effects of parameters.

    `basis` (samples, k) has orthonormal columns that span the derivatives with respect to the parameters;
    `residual` (samples,) is the residual orthogonal to them.
    """

    searched: SearchResult
    basis: Array
    residual: Array

    @classmethod
    def of(cls, searched: SearchResult, seed: int) -> Self:
        """Return the linear model of the parameters that `searched` has estimated."""
        samples = searched.objective.problem.samples
        jacobians = jacobians_of(searched, stream(seed, "Jacobians of a varying load"))
        return cls._of_columns(searched, jacobians.mean(axis=0)[:, :samples].T)

    def with_more(self, wider: MapObjective, point: Array) -> Self:
        """Return the linear model of all parameters of `wider`; `point` (d,) is the estimate in its space."""
        samples, space = self.residual.size, self.searched.objective.space
        added = [i for i, name in enumerate(wider.space.coordinates) if name not in space.coordinates]
        steps = STEP * np.eye(point.size)[added]
        up, down = np.split(wider.outputs(np.vstack([point + steps, point - steps]))[:, :samples], 2)
        return self._of_columns(self.searched, np.column_stack([self.basis, (up - down).T]))

    @classmethod
    def _of_columns(cls, searched: SearchResult, columns: Array) -> Self:
        """Return the linear model of parameters with derivatives `columns` (samples, k)."""
        basis, _ = np.linalg.qr(columns)
        residual = searched.residual[: len(columns)]
        return cls(searched, basis, residual - basis @ (basis.T @ residual))

    def share_of(self, mean_square: float) -> float:
        """Return a mean square as a share of the residual's, without noise and switching in both."""
        noise = self.searched.residual_variance / self.searched.normalised_residual**2
        return (mean_square - noise) / (self.searched.residual_variance - noise)

    @property
    def share_left(self) -> float:
        """Share of the mean squared residual, beyond noise and switching, that the linear model leaves."""
        return self.share_of(float(np.mean(self.residual**2)))

    def without(self, columns: Array) -> Array:
        """Return the part of `columns` (n, samples) that is orthogonal to the effects of the parameters."""
        return np.asarray(columns - (columns @ self.basis) @ self.basis.T)
