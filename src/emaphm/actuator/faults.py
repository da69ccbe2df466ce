"""The vector of eight normalised faults, its physical meaning, and the coordinates of the estimators."""

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
"""Least fraction of healthy turns in each phase in the models."""

LEAST_FRICTION_FACTOR = 0.1
"""Least dry friction relative to healthy: a lost preload removes most of it, seals and gear keep some."""


@dataclass(frozen=True)
class Faults:
    """Eight normalised faults, each in [0, 1], friction also below 0; the defaults are healthy (thesis 6.1).

    friction and backlash increase from 0 (healthy) to 1. A negative friction is dry friction below healthy,
    such as with a lost preload or a worn-in screw, down to the factor `LEAST_FRICTION_FACTOR`
    (`lower_bounds`). short_a, short_b and short_c are the fractions of short-circuited turns in each phase.
    eccentricity is the rotor's eccentricity and eccentricity_phase its direction (0 and 1 are -180 and +180
    deg; undefined without eccentricity). gain is 0.5 when healthy; 0 and 1 mean 0.5 and 1.5 times G_prop.

    Raises
    ------
    FaultError
        A component is not a number in [0, 1], or the friction not a number in [-1, 1].
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
        """Return the physical quantities of the faults on `actuator`, by name.

        The names are friction_factor [-], backlash_rad (at the motor) [rad], turns_a, turns_b, turns_c
        (fraction of healthy turns) [-], eccentricity_Z [-], eccentricity_phase_rad [rad] and
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
"""Components that can degrade; the direction of an eccentricity has no separate verdict."""


def degraded_in(document: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the degraded `COMPONENTS` of a diagnosis, given as `emaphm diagnose --json` prints it."""
    return tuple(name for name in COMPONENTS if document["faults"][name]["verdict"] == "degraded")


HEALTHS = ("degraded", "not explained", "cannot tell", "healthy")
"""Possible states of a unit according to a diagnosis, the most urgent first."""


def health_in(document: Mapping[str, Any]) -> str:
    """Return the state of a unit, one of `HEALTHS`, from a diagnosis as `emaphm diagnose --json` prints it.

    A unit is healthy if all `COMPONENTS` are healthy: a component without a verdict may be degraded.
    """
    if not document["explained"]:
        return "not explained"
    verdicts = {document["faults"][name]["verdict"] for name in COMPONENTS}
    return next((health for health in HEALTHS if health in verdicts), "cannot tell")


def lower_bounds(actuator: Actuator) -> NDArray[np.float64]:
    """Return the least value of each component on `actuator`, (8,); the largest value is 1.

    It is 0, except for friction: max(-(1 - f) / scale, -1), with f = `LEAST_FRICTION_FACTOR`.
    """
    lower = np.zeros(len(NAMES))
    least = (LEAST_FRICTION_FACTOR - 1) / actuator.faults.friction
    lower[NAMES.index("friction")] = max(least, LOWEST_FRICTION)
    return lower


def absent_faults(actuator: Actuator) -> dict[str, str]:
    """Return the components of `NAMES` that `actuator` cannot have, each with the reason."""
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
    """Return the `COMPONENTS` that `actuator` can have."""
    absent = absent_faults(actuator)
    return tuple(name for name in COMPONENTS if name not in absent)


def check_vectors(vectors: NDArray[np.float64], actuator: Actuator) -> None:
    """Refuse fault vectors (n, 8) with a component outside its range on `actuator`.

    Raises
    ------
    FaultError
        A component is outside its range; the message names the first such component and its range.
    """
    lower = lower_bounds(actuator)
    outside = np.argwhere(~((vectors >= lower) & (vectors <= 1)))
    if outside.size:
        row, column = outside[0]
        place = f" of vector {row}" if len(vectors) > 1 else ""
        fault = f"fault {NAMES[column]}={vectors[row, column]:g}{place}"
        raise FaultError(_outside(fault, float(lower[column])))


def whole_turns(name: str) -> tuple[float, ...]:
    """Return the differences between values of a component that are equivalent, in its unit.

    The phase is a direction: 0 and 1 are equivalent, and an interval may extend beyond either. For all other
    components only equal values are equivalent.
    """
    return (-1.0, 0.0, 1.0) if name == "eccentricity_phase" else (0.0,)


def _outside(fault: str, lowest: float) -> str:
    return f"{fault} lies outside [{lowest:g}, 1]; give a value from {lowest:g} to 1"


CARTESIAN_NAMES = (*NAMES[:5], "eccentricity_x", "eccentricity_y", "gain")
"""Coordinates of the estimators, without wrapping and without a false minimum at eccentricity 0."""


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
