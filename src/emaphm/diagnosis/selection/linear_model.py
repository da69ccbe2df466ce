"""What a linear model about an estimate does to the current, with nuisances that were not estimated there."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.uncertainty.local_covariance import jacobians_of
from emaphm.random_streams import stream

STEP = 0.02
"""Of a coordinate, for a derivative: a tenth of a standard deviation of the prior."""


@dataclass(frozen=True, eq=False)
class LinearModel:
    """What linear combinations leave of the current's residual at the estimate `searched`.

    `basis` (samples, k) are orthonormal columns of what the parameters do, and `residual` (samples,) is that
    which they leave.
    """

    searched: SearchResult
    basis: Array
    residual: Array

    @classmethod
    def of(cls, searched: SearchResult, seed: int) -> Self:
        """Return that of the parameters that `searched` has estimated."""
        samples = searched.objective.problem.samples
        jacobians = jacobians_of(searched, stream(seed, "Jacobians of a varying load"))
        return cls._of_columns(searched, jacobians.mean(axis=0)[:, :samples].T)

    def with_more(self, wider: MapObjective, point: Array) -> Self:
        """Return that of all parameters of `wider`, at `point` (d,): the estimate there."""
        samples, before = self.residual.size, self.searched.objective.space
        more = [i for i, name in enumerate(wider.space.coordinates) if name not in before.coordinates]
        steps = STEP * np.eye(point.size)[more]
        up, down = np.split(wider.outputs(np.vstack([point + steps, point - steps]))[:, :samples], 2)
        return self._of_columns(self.searched, np.column_stack([self.basis, (up - down).T]))

    @classmethod
    def _of_columns(cls, searched: SearchResult, columns: Array) -> Self:
        """Return that of parameters that do `columns` (samples, k)."""
        basis, _ = np.linalg.qr(columns)
        residual = searched.residual[: len(columns)]
        return cls(searched, basis, residual - basis @ (basis.T @ residual))

    def share_of(self, mean_square: float) -> float:
        """Return which share of the mean square beyond noise and switching is a `mean_square`."""
        noise = self.searched.residual_variance / self.searched.normalised_residual**2
        return (mean_square - noise) / (self.searched.residual_variance - noise)

    @property
    def share_left(self) -> float:
        """The share of the mean square beyond noise and switching that is left."""
        return self.share_of(float(np.mean(self.residual**2)))

    def without(self, columns: Array) -> Array:
        """Return what the parameters do not of `columns` (n, samples)."""
        return np.asarray(columns - (columns @ self.basis) @ self.basis.T)
