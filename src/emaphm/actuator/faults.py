"""The vector of eight normalised faults, its physical meaning, and the form that estimators use."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Self, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emaphm.actuator.actuator import Actuator
from emaphm.actuator.requirements import LOWEST_FRICTION, ComponentName
from emaphm.errors import FaultError, nearest

SHORTEST_WINDING = 0.01
"""The models keep at least this fraction of healthy turns in each phase."""

LEAST_FRICTION_FACTOR = 0.1
"""Least dry friction relative to healthy: a lost preload takes most of it, seals and gear leave some."""


@dataclass(frozen=True)
class Faults:
    """Eight normalised faults, each in [0, 1], friction also below; the defaults are healthy (thesis 6.1).

    friction and backlash grow from 0 (healthy) to 1. A negative friction is dry friction below healthy, as of
    a lost preload or a worn-in screw, down to `LEAST_FRICTION_FACTOR` of it (`lower_bounds`). short_a,
    short_b, short_c are the fraction of short-circuited turns in each phase; eccentricity is that of the
    rotor and eccentricity_phase its direction (0 and 1 are -180 and +180 deg; meaningless without
    eccentricity); gain is 0.5 when healthy, 0 and 1 being the drive's position gain halved and half as much
    again.

    Raises
    ------
    FaultError
        A component is not a number in [0, 1], or the friction not one in [-1, 1].
    """

    friction: float = 0.0
    backlash: float = 0.0
    short_a: float = 0.0
    short_b: float = 0.0
    short_c: float = 0.0
    eccentricity: float = 0.0
    eccentricity_phase: float = 0.5
    gain: float = 0.5

    def __post_init__(self) -> None:
        for name in NAMES:
            given = getattr(self, name)
            try:
                value = float(given)
            except (TypeError, ValueError):
                raise FaultError(f"fault {name}={given!r} is no number; give a value from 0 to 1") from None
            lowest = LOWEST_FRICTION if name == "friction" else 0.0
            if not lowest <= value <= 1.0:  # also refuses NaN
                raise FaultError(_outside(f"fault {name}={value:g}", lowest))
            object.__setattr__(self, name, value)

    @classmethod
    def from_vector(cls, vector: ArrayLike) -> Self:
        """Return the faults of a vector k of shape (8,)."""
        values = np.asarray(vector, float)
        if values.shape != (len(NAMES),):
            raise FaultError(f"a fault vector has {len(NAMES)} components, got shape {values.shape}")
        return cls(*(float(value) for value in values))

    @classmethod
    def from_mapping(cls, values: Mapping[str, float]) -> Self:
        """Return healthy faults with the named components set; a misspelt name raises `FaultError`."""
        for name in values:
            if name not in NAMES:
                raise FaultError(f"unknown fault '{name}'{nearest(name, NAMES)}")
        return cls(**values)

    @property
    def vector(self) -> NDArray[np.float64]:
        """The vector k, shape (8,)."""
        return np.array([getattr(self, name) for name in NAMES])

    def physical(self, actuator: Actuator) -> dict[str, float]:
        """Return what the faults mean on `actuator`.

        Keys: friction_factor [-], backlash_rad (at the motor) [rad], turns_a, turns_b, turns_c
        (fraction of healthy turns) [-], eccentricity_Z [-], eccentricity_phase_rad [rad],
        gain_factor [-].
        """
        scales = actuator.faults
        return {
            "friction_factor": 1 + scales.friction * self.friction,
            "backlash_rad": actuator.mechanics.backlash * (1 + scales.backlash * self.backlash),
            "turns_a": 1 - self.short_a,
            "turns_b": 1 - self.short_b,
            "turns_c": 1 - self.short_c,
            "eccentricity_Z": scales.eccentricity * self.eccentricity,
            "eccentricity_phase_rad": (2 * self.eccentricity_phase - 1) * math.pi,
            "gain_factor": 1 + scales.gain * (2 * self.gain - 1),
        }


NAMES = tuple(field.name for field in fields(Faults))
HEALTHY = Faults()

COMPONENTS: tuple[str, ...] = get_args(ComponentName)
"""What can degrade; the direction of an eccentricity is none of its own and shares its verdict."""


def degraded_in(document: Mapping[str, Any]) -> tuple[str, ...]:
    """Return those of `COMPONENTS` that a diagnosis calls degraded, as `emaphm diagnose --json` prints it."""
    return tuple(name for name in COMPONENTS if document["faults"][name]["verdict"] == "degraded")


HEALTHS = ("degraded", "not explained", "cannot tell", "healthy")
"""What a diagnosis says of its unit, what is most to be looked after first."""


def health_in(document: Mapping[str, Any]) -> str:
    """Return which of `HEALTHS` a diagnosis says of its unit, as `emaphm diagnose --json` prints it.

    A unit is healthy where each of `COMPONENTS` is: one without a verdict may be degraded.
    """
    if not document["explained"]:
        return "not explained"
    found = {document["faults"][name]["verdict"] for name in COMPONENTS}
    return next((one for one in HEALTHS if one in found), "cannot tell")


def lower_bounds(actuator: Actuator) -> NDArray[np.float64]:
    """Return the least value of each component on `actuator`, (8,); the largest is 1.

    0, but for the friction: -(1 - f) / scale, f being `LEAST_FRICTION_FACTOR`, and -1 at least.
    """
    lower = np.zeros(len(NAMES))
    least = (LEAST_FRICTION_FACTOR - 1) / actuator.faults.friction
    lower[NAMES.index("friction")] = max(least, LOWEST_FRICTION)
    return lower


def absent_faults(actuator: Actuator) -> dict[str, str]:
    """Return why `actuator` cannot have each of the components of `NAMES` that it cannot have."""
    absent = {}
    if actuator.mechanics.static_friction == 0:
        absent["friction"] = "the healthy friction is zero, so its fault scales nothing"
    if actuator.mechanics.backlash == 0:
        absent["backlash"] = "the healthy backlash is zero, so its fault scales nothing"
    if not actuator.three_phases:
        reason = (
            "needs an electrical description, which the actuator lacks"
            if actuator.electrical is None
            else "needs a motor of three phases"
        )
        absent |= dict.fromkeys(NAMES[2:7], reason)
    return absent


def present_components(actuator: Actuator) -> tuple[str, ...]:
    """Return those of `COMPONENTS` that `actuator` can have."""
    absent = absent_faults(actuator)
    return tuple(name for name in COMPONENTS if name not in absent)


def check_vectors(vectors: NDArray[np.float64], actuator: Actuator) -> None:
    """Refuse fault vectors (n, 8) with a component that `actuator` cannot have.

    Raises
    ------
    FaultError
        It names the first such component and its range.
    """
    lower = lower_bounds(actuator)
    outside = np.argwhere(~((vectors >= lower) & (vectors <= 1)))
    if outside.size:
        row, column = outside[0]
        where = f" of vector {row}" if len(vectors) > 1 else ""
        what = f"fault {NAMES[column]}={vectors[row, column]:g}{where}"
        raise FaultError(_outside(what, float(lower[column])))


def whole_turns(name: str) -> tuple[float, ...]:
    """Return by how much values of a component may differ and mean the same, in its unit.

    The phase is a direction: 0 and 1 are the same, and an interval of it may run past either. All other
    components are amounts, of which only equal ones are the same.
    """
    return (-1.0, 0.0, 1.0) if name == "eccentricity_phase" else (0.0,)


def _outside(what: str, lowest: float) -> str:
    return f"{what} lies outside [{lowest:g}, 1]; give a value from {lowest:g} to 1"


CARTESIAN_NAMES = (*NAMES[:5], "eccentricity_x", "eccentricity_y", "gain")
"""Coordinates an estimator works in: no wrap, and no false minimum where the eccentricity is 0."""


def to_cartesian(vectors: ArrayLike) -> NDArray[np.float64]:
    """Return fault vectors (…, 8) with (k6, k7) replaced by k6 (cos phi, sin phi)."""
    k = np.array(vectors, float)
    phase = (2 * k[..., 6] - 1) * np.pi
    k[..., 5], k[..., 6] = k[..., 5] * np.cos(phase), k[..., 5] * np.sin(phase)
    return k


def from_cartesian(points: ArrayLike) -> NDArray[np.float64]:
    """Return the fault vectors (…, 8) of points in estimator coordinates; inverse of `to_cartesian`."""
    k = np.array(points, float)
    radius = np.hypot(k[..., 5], k[..., 6])
    phase = np.where(radius > 0, np.arctan2(k[..., 6], k[..., 5]), 0.0)
    k[..., 5], k[..., 6] = radius, phase / (2 * np.pi) + 0.5
    return k
