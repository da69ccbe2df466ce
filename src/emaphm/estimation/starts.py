"""Starting points of a search without a global stage: estimates of the same recording by another method."""

from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.space.parameter_space import ParameterSpace


@dataclass(frozen=True, eq=False)
class Starts:
    """Starting `points` (n, d), their `coordinates` (d,) by name, and the `method` that estimated them."""

    method: str
    points: Array
    coordinates: tuple[str, ...]

    def of(self, space: ParameterSpace) -> Array:
        """Return the points in `space`: its additional coordinates are 0, missing ones are left out."""
        points = np.zeros((len(self.points), space.dimensions))
        for i, name in enumerate(space.coordinates):
            if name in self.coordinates:
                points[:, i] = self.points[:, self.coordinates.index(name)]
        return space.project(points)
