"""Deviations of the physical parameters of a unit from its description: free, or with a known covariance.

A deviation is relative (a difference of logarithms) for positive parameters, and in the parameter's own unit
for signed parameters such as a constant load.
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
"""Factor on the description's value, in either direction, that bounds the search for a parameter."""

START_FACTOR = 3.0
"""Approximate factor within which the description's values are correct."""

PRESLIDING = ("presliding_stiffness", "presliding_damping")
SPEEDS = ("stribeck_speed", "transition_speed")
"""Speeds of the friction laws, which the other parameters of a description do not imply."""

WIDE = (*SPEEDS, *PRESLIDING, "stiffness", "current_lag", "source_resistance", "voltage_drop")
"""Parameters of optional laws whose size a description does not imply."""

WIDE_START_FACTOR = 20.0
"""Approximate factor on a law's usual value within which a search for these parameters starts."""

REACH = 4.0
"""Bound of a parameter with a known standard deviation, in standard deviations."""

LEAST_DEVIATION = 1e-3
"""Relative standard deviation of a direction of a baseline below which it counts as known: the resolution of
a search."""


@dataclass(frozen=True, eq=False)
class ParameterVariation:
    """Parameters that may deviate, and the coordinates of their deviations.

    `axes`, (parameters, q), is the deviation of each parameter per unit of each coordinate. `priors`, (q,),
    is the prior standard deviation of each coordinate, `widest`, (q,), its bound.
    """

    parameters: tuple[str, ...]
    axes: Array
    priors: Array
    widest: Array

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names, (q,): the parameter's name for a coordinate of exactly one parameter, otherwise a number."""
        acting = self.axes != 0
        one_to_one = acting & (acting.sum(axis=0) == 1) & (acting.sum(axis=1, keepdims=True) == 1)
        columns = enumerate(one_to_one.T, 1)
        return tuple(
            self.parameters[int(column.argmax())] if column.any() else str(i) for i, column in columns
        )

    @classmethod
    def free(cls, actuator: Actuator, names: tuple[str, ...]) -> Self:
        """Return `names` as independent coordinates with hardly any prior information.

        Raises
        ------
        MethodError
            A name is unknown or needs a section that the actuator does not have, or its value is 0.
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
        """Return the variation with priors of at most the standard `deviations`, by parameter."""
        known = [deviations.get(name, math.inf) for name in self.parameters]
        priors = np.minimum(self.priors, known)
        return replace(self, priors=priors, widest=np.minimum(self.widest, REACH * priors))

    @classmethod
    def suspected(cls, actuator: Actuator, names: tuple[str, ...]) -> Self:
        """Return `names` as independent coordinates, whose priors have the width of their start factors."""
        free = cls.free(actuator, names)
        return replace(free, priors=start_widths(names))

    def combined_with(self, other: Self) -> Self:
        """Return the parameters of this and the `other` variation, which have none in common."""
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
        """Return the uncertain parameters of the unit: by its baseline, all others by their tolerances."""
        calibrated, tolerances = cls._of_baseline(actuator), actuator.open_tolerances
        if tolerances is None:
            return calibrated
        return calibrated.combined_with(cls.free(actuator, tolerances.names).known_to(tolerances.deviations))

    @classmethod
    def _of_baseline(cls, actuator: Actuator) -> Self:
        """Return the principal axes of the actuator's baseline that are not known to `LEAST_DEVIATION`."""
        if actuator.baseline is None:
            return cls((), np.zeros((0, 0)), np.zeros(0), np.zeros(0))
        names = actuator.baseline.names
        size = sizes(actuator, names)
        variances, directions = np.linalg.eigh(np.array(actuator.baseline.covariance) / np.outer(size, size))
        uncertain = variances > LEAST_DEVIATION**2
        if not uncertain.any():
            return cls((), np.zeros((0, 0)), np.zeros(0), np.zeros(0))
        # Directions that calibration could not identify are as uncertain as those of any description.
        priors = np.minimum(np.sqrt(variances[uncertain]), math.log(START_FACTOR))
        widest = np.minimum(REACH * priors, math.log(WIDEST_FACTOR))
        return cls(names, size[:, np.newaxis] * directions[:, uncertain], priors, widest)


def start_widths(names: tuple[str, ...]) -> Array:
    """Return the largest distance of a search's starts from the description, as logarithms, (names,)."""
    return np.log([WIDE_START_FACTOR if name in WIDE else START_FACTOR for name in names])


def sizes(actuator: Actuator, names: tuple[str, ...]) -> Array:
    """Return the deviation of each of `names` that is equivalent to 1 of a logarithm, shape (names,)."""
    # The unit of a signed parameter is the quantity that it is added to; for torques, the friction torque.
    friction = (
        actuator.mechanics.dynamic_friction
        or actuator.controller.current_limit * actuator.motor.torque_constant
    )
    by_name = {
        "coulomb_asymmetry": 0.25,
        "viscous_asymmetry": 0.25,
        "gravity_angle": 0.25,
        "rotor_zero": 0.25,
        "saturation": 0.25 / actuator.controller.current_limit,
        "sine_share": 0.3,
        **dict.fromkeys((*HALL_SENSORS, "commutation_lag"), 0.05),
        "commutation_delay": 5e-5,
    }
    return np.array([by_name.get(name, friction) if name in SIGNED else 1.0 for name in names])


def varied(actuator: Actuator, name: str, variation: Array) -> Array:
    """Return the lumped parameter `name` for a `variation` from the description, with its shape."""
    described = lumped_parameters(actuator, (name,))[name]
    return np.asarray(described + variation if name in SIGNED else described * np.exp(variation))


def variation_unit(name: str, coordinates: str) -> str:
    """Return the unit of a variation of the lumped parameter `name`."""
    return unit_for(LUMPED_PARAMETERS[name], coordinates) if name in SIGNED else "-"
