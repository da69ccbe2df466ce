"""Coordinates of an estimator: the faults that an actuator can have, and their bounds."""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from emaphm.actuator import NAMES, Actuator
from emaphm.actuator.faults import (
    CARTESIAN_NAMES,
    HEALTHY,
    absent_faults,
    from_cartesian,
    lower_bounds,
    to_cartesian,
)
from emaphm.arrays import Array
from emaphm.estimation.space.nuisances import NO_NUISANCES, NuisanceSet
from emaphm.quantiles import normal_quantile

SHORTS = NAMES[2:5]
ECCENTRICITY = NAMES[5:7]

HEALTHY_POINT = to_cartesian(HEALTHY.vector)
"""Healthy faults in estimator coordinates, (8,)."""

PRIOR_DEVIATION = 1 / 12**0.5
"""Standard deviation of a component that is uniform in [0, 1]; also used for friction, which may be less."""


@dataclass(frozen=True, eq=False)
class Box:
    """Bounds of an estimate, shape (d,) each; `project` moves points (n, d) to the nearest allowed points."""

    lower: Array
    upper: Array

    def project(self, points: Array) -> Array:
        """Return `points` (…, d) moved into the bounds."""
        return np.clip(points, self.lower, self.upper)


@dataclass(frozen=True, eq=False)
class ParameterSpace(Box):
    """The faults that can be estimated, the eccentricity as k6 (cos phi, sin phi) inside the unit circle.

    `columns` are the estimated columns of a vector in estimator coordinates (see
    `emaphm.actuator.faults.CARTESIAN_NAMES`); `fixed` states for every other component the reason why it is
    assumed to be healthy. The last coordinates of a point are those of the `nuisances`.
    """

    columns: tuple[int, ...]
    fixed: dict[str, str]
    nuisances: NuisanceSet

    @classmethod
    def of(
        cls, actuator: Actuator, nuisances: NuisanceSet = NO_NUISANCES, *, below_healthy: bool = True
    ) -> Self:
        """Return the space of the faults that `actuator` can have, and of `nuisances`.

        Without `below_healthy`, friction is at least healthy, as in the thesis.
        """
        fixed = absent_faults(actuator)
        columns = tuple(i for i, name in enumerate(NAMES) if name not in fixed)
        lower = lower_bounds(actuator) if below_healthy else np.zeros(len(NAMES))
        upper = np.ones(len(NAMES))
        lower[5:7] = -1.0
        return cls(
            np.concatenate([lower[list(columns)], -nuisances.widest]),
            np.concatenate([upper[list(columns)], nuisances.widest]),
            columns,
            fixed,
            nuisances,
        )

    @classmethod
    def healthy(cls, nuisances: NuisanceSet) -> Self:
        """Return the space of the `nuisances` alone, for a unit that is known to be healthy."""
        return cls(-nuisances.widest, nuisances.widest, (), {}, nuisances)

    @property
    def dimensions(self) -> int:
        """The number of coordinates, d."""
        return len(self.lower)

    @property
    def coordinates(self) -> tuple[str, ...]:
        """The name of each coordinate."""
        return (*(CARTESIAN_NAMES[i] for i in self.columns), *self.nuisances.names)

    @property
    def prior_deviations(self) -> Array:
        """The prior standard deviation of each coordinate, shape (d,)."""
        return np.concatenate([np.full(len(self.columns), PRIOR_DEVIATION), self.nuisances.priors])

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
        full = np.broadcast_to(HEALTHY_POINT, (*points.shape[:-1], len(NAMES))).copy()
        full[..., list(self.columns)] = points[..., : len(self.columns)]
        return from_cartesian(full).clip(self._least, 1.0)

    @cached_property
    def _least(self) -> Array:
        """The least value of each fault component, (8,)."""
        return np.array([self.limits(name)[0] for name in NAMES])

    def limits(self, name: str) -> tuple[float, float]:
        """Return the least and the largest value of a fault component."""
        below = name == "friction" and self.columns[:1] == (0,)
        return (float(self.lower[0]) if below else 0.0), 1.0

    def points(self, faults: ArrayLike) -> Array:
        """Return the points (…, d) of normalised fault vectors (…, 8), the nuisances at 0."""
        cartesian: Array = to_cartesian(faults)[..., list(self.columns)]
        unknown = np.zeros((*cartesian.shape[:-1], len(self.nuisances.names)))
        return np.concatenate([cartesian, unknown], axis=-1)

    def carried_over(self, point: Array, space: "ParameterSpace") -> Array:
        """Return the coordinates (d,) of a `point` of another `space`; missing coordinates are nominal."""
        values = dict(zip(space.coordinates, point.tolist(), strict=True))
        nominal = dict(zip(self.nuisances.names, self.nuisances.nominal.tolist(), strict=True))
        return np.array([values.get(name, nominal.get(name, 0.0)) for name in self.coordinates])

    def nuisance_values(self, points: ArrayLike) -> dict[str, Array]:
        """Return the values (n,) of the nuisances' quantities at `points` (n, d), each in its own unit."""
        return self.nuisances.values(np.asarray(points, float)[:, len(self.columns) :])

    def prior_transform(self, unit: ArrayLike) -> Array:
        """Return points (n, d) for `unit` (n, d) in [0, 1]: uniform faults, nuisances with normal priors.

        A prior as wide as the bounds is truncated there. Friction below healthy is left to descents.
        """
        shares = np.asarray(unit, float)
        faults = np.tile(HEALTHY.vector, (len(shares), 1))
        faults[:, list(self.columns)] = shares[:, : len(self.columns)]
        points = self.points(faults)
        normal = normal_quantile(np.clip(shares[:, len(self.columns) :], 0.02, 0.98))
        widest = self.nuisances.widest
        points[:, len(self.columns) :] = np.clip(self.nuisances.priors * normal, -widest, widest)
        return points
