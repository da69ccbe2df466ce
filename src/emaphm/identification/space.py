"""The coordinates that an estimator works in: which faults an actuator can show, and their bounds."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emaphm.actuator import NAMES, Actuator
from emaphm.actuator.faults import HEALTHY, from_cartesian, to_cartesian

Array = NDArray[np.float64]

SHORTS = NAMES[2:5]
ECCENTRICITY = NAMES[5:7]


@dataclass(frozen=True, eq=False)
class Box:
    """Bounds of an estimate, shape (d,) each; `project` takes any point (n, d) to the nearest allowed one."""

    lower: Array
    upper: Array

    def project(self, points: Array) -> Array:
        """Return `points` (…, d) moved into the bounds."""
        return np.clip(points, self.lower, self.upper)


@dataclass(frozen=True, eq=False)
class FaultSpace(Box):
    """The faults that can be estimated, the eccentricity as k6 (cos phi, sin phi) inside the unit circle.

    `columns` are the estimated columns of a vector in estimator coordinates (see
    `emaphm.actuator.faults.CARTESIAN_NAMES`); `fixed` says for every other component why it is taken
    as healthy.
    """

    columns: tuple[int, ...]
    fixed: dict[str, str]

    @classmethod
    def of(cls, actuator: Actuator) -> Self:
        """Return the space of the faults that `actuator` can show."""
        fixed = {}
        if actuator.mechanics.static_friction == 0:
            fixed["friction"] = "the healthy friction is zero, so its fault scales nothing"
        if actuator.mechanics.backlash == 0:
            fixed["backlash"] = "the healthy backlash is zero, so its fault scales nothing"
        if actuator.electrical is None:
            reason = "needs an electrical description, which the actuator lacks"
            fixed |= dict.fromkeys((*SHORTS, *ECCENTRICITY), reason)
        columns = tuple(i for i, name in enumerate(NAMES) if name not in fixed)
        lower, upper = np.zeros(len(NAMES)), np.ones(len(NAMES))
        lower[5:7] = -1.0
        return cls(lower[list(columns)], upper[list(columns)], columns, fixed)

    @property
    def dimensions(self) -> int:
        """The number of coordinates, d."""
        return len(self.columns)

    def project(self, points: Array) -> Array:
        """Return `points` (…, d) moved into the bounds and the eccentricity into its circle."""
        points = np.array(points, float)
        if 5 in self.columns:
            x = self.columns.index(5)
            radius = np.hypot(points[..., x], points[..., x + 1])[..., np.newaxis]
            points[..., x : x + 2] /= np.maximum(radius, 1.0)
        return np.clip(points, self.lower, self.upper)

    def faults(self, points: ArrayLike) -> Array:
        """Return the normalised fault vectors (…, 8) of `points` (…, d)."""
        points = np.asarray(points, float)
        full = np.broadcast_to(to_cartesian(HEALTHY.vector), (*points.shape[:-1], len(NAMES))).copy()
        full[..., list(self.columns)] = points
        return np.clip(from_cartesian(full), 0.0, 1.0)

    def points(self, faults: ArrayLike) -> Array:
        """Return the points (…, d) of normalised fault vectors (…, 8)."""
        cartesian: Array = to_cartesian(faults)[..., list(self.columns)]
        return cartesian

    def spread(self, unit: ArrayLike) -> Array:
        """Return points (n, d) for `unit` (n, d) in [0, 1]: normalised faults, evenly spread."""
        faults = np.tile(HEALTHY.vector, (len(np.asarray(unit)), 1))
        faults[:, list(self.columns)] = unit
        return self.points(faults)
