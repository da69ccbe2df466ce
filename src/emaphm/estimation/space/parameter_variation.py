"""How the physical parameters of one unit may deviate from its description: free, or as far as that is known.

A deviation is relative (of the logarithm) for what is positive, in its own unit for a constant load.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.lumped_parameters import LUMPED_PARAMETERS, lumped_parameters
from emaphm.actuator.quantity import unit_for
from emaphm.actuator.unit.baseline import HALL_SENSORS, SIGNED
from emaphm.arrays import Array
from emaphm.errors import MethodError

WIDEST_FACTOR = 30.0
"""A parameter is sought within this factor of the description's value, either way."""

START_FACTOR = 3.0
"""A description's values are right within this factor, or so."""

PRESLIDING = ("presliding_stiffness", "presliding_damping")
SPEEDS = ("stribeck_speed", "transition_speed")
"""Speeds of the friction laws, which the rest of a description does not imply."""

WIDE = (*SPEEDS, *PRESLIDING, "stiffness", "current_lag", "source_resistance", "voltage_drop")
"""Parameters of optional laws whose size a description does not imply."""

WIDE_START_FACTOR = 20.0
"""A search for them starts within this factor of a law's usual value, or so."""

REACH = 4.0
"""Bound of what is known, in standard deviations."""

LEAST_DEVIATION = 1e-3
"""A direction in which a baseline is known better, relative, counts as known: a search resolves no less."""


@dataclass(frozen=True, eq=False)
class ParameterVariation:
    """Parameters that may deviate, and the coordinates that they do so in.

    `axes`, (parameters, q), is what a unit of each coordinate makes of each deviation. `priors`, (q,), is
    the standard deviation of each coordinate before the data, `widest`, (q,), its bound.
    """

    parameters: tuple[str, ...]
    axes: Array
    priors: Array
    widest: Array

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names, (q,): the parameter's where a coordinate alone varies it, and nothing else; else numbers."""
        acting = self.axes != 0
        alone = acting & (acting.sum(axis=0) == 1) & (acting.sum(axis=1, keepdims=True) == 1)
        named = enumerate(alone.T, 1)
        return tuple(self.parameters[int(one.argmax())] if one.any() else str(i) for i, one in named)

    @classmethod
    def free(cls, actuator: Actuator, names: tuple[str, ...]) -> Self:
        """Return `names` as coordinates of their own, of which next to nothing is known.

        Raises
        ------
        MethodError
            A name is unknown or needs a section that the actuator lacks, or its value is 0.
        """
        for name, value in lumped_parameters(actuator, names).items():
            if value <= 0 and name not in SIGNED:
                raise MethodError(
                    f"parameter '{name}' is {value:g} in actuator '{actuator.name}', so its size is unknown; "
                    "give an estimate there to start from"
                )
        widest = np.full(len(names), math.log(WIDEST_FACTOR))
        return cls(names, np.diag(sizes(actuator, names)), widest, widest)

    def known_to(self, deviations: Mapping[str, float]) -> Self:
        """Return coordinates of their own, some of which have a narrower prior: standard `deviations`."""
        known = [deviations.get(name, math.inf) for name in self.parameters]
        priors = np.minimum(self.priors, known)
        return replace(self, priors=priors, widest=np.minimum(self.widest, REACH * priors))

    @classmethod
    def suspected(cls, actuator: Actuator, names: tuple[str, ...]) -> Self:
        """Return `names` as coordinates of their own, each within its start factor or so of its value."""
        free = cls.free(actuator, names)
        return replace(free, priors=start_widths(names))

    def combined_with(self, other: Self) -> Self:
        """Return the parameters of both, which have none in common."""
        rows, columns = self.axes.shape
        axes = np.zeros((rows + other.axes.shape[0], columns + other.axes.shape[1]))
        axes[:rows, :columns], axes[rows:, columns:] = self.axes, other.axes
        return type(self)(
            (*self.parameters, *other.parameters),
            axes,
            np.concatenate([self.priors, other.priors]),
            np.concatenate([self.widest, other.widest]),
        )

    @classmethod
    def of_unit(cls, actuator: Actuator) -> Self:
        """Return what is left open of the unit: by its baseline, and by the tolerances of all others."""
        calibrated, tolerances = cls._of_baseline(actuator), actuator.open_tolerances
        if tolerances is None:
            return calibrated
        return calibrated.combined_with(cls.free(actuator, tolerances.names).known_to(tolerances.deviations))

    @classmethod
    def _of_baseline(cls, actuator: Actuator) -> Self:
        """Return the principal axes of the actuator's baseline, less those that are known exactly enough."""
        if actuator.baseline is None:
            return cls((), np.zeros((0, 0)), np.zeros(0), np.zeros(0))
        names = actuator.baseline.names
        size = sizes(actuator, names)
        variances, directions = np.linalg.eigh(np.array(actuator.baseline.covariance) / np.outer(size, size))
        kept = variances > LEAST_DEVIATION**2
        if not kept.any():
            return cls((), np.zeros((0, 0)), np.zeros(0), np.zeros(0))
        # What calibration could not identify is no farther off than any description.
        priors = np.minimum(np.sqrt(variances[kept]), math.log(START_FACTOR))
        widest = np.minimum(REACH * priors, math.log(WIDEST_FACTOR))
        return cls(names, size[:, np.newaxis] * directions[:, kept], priors, widest)


def start_widths(names: tuple[str, ...]) -> Array:
    """Return how far from the description a search for each of `names` starts, by the logarithm, (names,)."""
    return np.log([WIDE_START_FACTOR if name in WIDE else START_FACTOR for name in names])


def sizes(actuator: Actuator, names: tuple[str, ...]) -> Array:
    """Return the deviation of each of `names` that is as much as 1 of a logarithm, shape (names,)."""
    # What has a sign is measured in units of what it adds to: torques in units of what friction alone takes.
    friction = (
        actuator.mechanics.dynamic_friction
        or actuator.controller.current_limit * actuator.motor.torque_constant
    )
    others = {
        "coulomb_asymmetry": 0.25,
        "viscous_asymmetry": 0.25,
        "gravity_angle": 0.25,
        "rotor_zero": 0.25,
        "saturation": 0.25 / actuator.controller.current_limit,
        "sine_share": 0.3,
        **dict.fromkeys((*HALL_SENSORS, "commutation_lag"), 0.05),
        "commutation_delay": 5e-5,
    }
    return np.array([others.get(name, friction) if name in SIGNED else 1.0 for name in names])


def varied(actuator: Actuator, name: str, variation: Array) -> Array:
    """Return the lumped parameter `name` at a `variation`, of any shape, from the description."""
    described = lumped_parameters(actuator, (name,))[name]
    return np.asarray(described + variation if name in SIGNED else described * np.exp(variation))


def variation_unit(name: str, coordinates: str) -> str:
    """Return the unit of a variation of the lumped parameter `name`."""
    return unit_for(LUMPED_PARAMETERS[name], coordinates) if name in SIGNED else "-"
