"""Points where a search begins in place of a global stage: what another method has made of the recording."""

from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.space.parameter_space import ParameterSpace


@dataclass(frozen=True, eq=False)
class Starts:
    """`points` (n, d) in `coordinates` (d,) of their own, and the `method` that has found them."""

    method: str
    points: Array
    coordinates: tuple[str, ...]

    def of(self, space: ParameterSpace) -> Array:
        """Return the points in `space`: what it has in addition is at 0, what it lacks is left out."""
        points = np.zeros((len(self.points), space.dimensions))
        for i, name in enumerate(space.coordinates):
            if name in self.coordinates:
                points[:, i] = self.points[:, self.coordinates.index(name)]
        return space.project(points)
