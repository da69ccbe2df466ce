"""`[tolerances]`: tolerances of the described values, from a data sheet or a drawing."""

import math
from typing import Any, Self

from pydantic import model_validator

from emaphm.actuator.quantity import quantity
from emaphm.actuator.section import Section
from emaphm.actuator.unit.baseline import LUMPED_PARAMETERS

DEVIATIONS = 2.0
"""Number of standard deviations in a tolerance, which includes 95 of 100 units."""

LARGEST_TOLERANCE = 2.0
"""Largest tolerance: a value that may deviate by more than a factor of 3 is not a description."""


def _tolerance(meaning: str) -> Any:
    return quantity(f"± {meaning}, relative", "-", "data sheet", default=None, gt=0, le=LARGEST_TOLERANCE)


class Tolerances(Section):
    """Relative tolerances of described values: 0.1 is ± 10 %.

    A diagnosis estimates these parameters with the faults, with a prior about the described value x: for a
    tolerance t, 95 of 100 units have values between x / (1 + t) and x (1 + t). The logarithms are independent
    and normal with the standard deviation ln(1 + t) / 2 (JCGM 100:2008, 4.3.4: limits that contain 95 of 100
    values). For a calibrated parameter, the `Baseline` replaces the tolerance.
    """

    torque_constant: float | None = _tolerance("torque constant, and back-EMF constant")
    resistance: float | None = _tolerance("resistance of the windings")
    inductance: float | None = _tolerance("inductance of the windings")
    supply: float | None = _tolerance("supply voltage")
    inertia: float | None = _tolerance("inertia of motor and user together")
    viscous: float | None = _tolerance("viscous friction of motor and user together")
    coulomb: float | None = _tolerance("dynamic friction, and static friction in proportion")
    static: float | None = _tolerance("static friction")
    hinge: float | None = _tolerance("load stiffness")
    backlash: float | None = _tolerance("backlash of the healthy actuator")
    stiffness: float | None = _tolerance("stiffness of the shaft")
    damping: float | None = _tolerance("damping of the shaft")
    gravity: float | None = _tolerance("moment of the weight")
    stribeck_speed: float | None = _tolerance("Stribeck speed")
    position_gain: float | None = _tolerance("gain of the position loop")
    position_integral_gain: float | None = _tolerance("integral gain of the position loop")
    position_derivative_gain: float | None = _tolerance("derivative gain of the position loop")
    speed_gain: float | None = _tolerance("proportional gain of the speed loop")
    integral_gain: float | None = _tolerance("integral gain of the speed loop")
    derivative_gain: float | None = _tolerance("derivative gain of the speed loop")
    command_lag: float | None = _tolerance("time constant of the command's way to the controller")
    speed_lag: float | None = _tolerance("time constant of the speed feedback")
    torque_lag: float | None = _tolerance("time constant from current to torque")
    current_gain: float | None = _tolerance("proportional gain of the current control")
    current_integral_gain: float | None = _tolerance("integral gain of the current control")
    source_resistance: float | None = _tolerance("resistance of the supply and its leads")
    voltage_drop: float | None = _tolerance("voltage drop of the inverter")

    @model_validator(mode="after")
    def _check_not_empty(self) -> Self:
        if not self.names:
            raise ValueError("states no tolerance; name a parameter, such as torque_constant = 0.1")
        return self

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters with a tolerance, in the order of `LUMPED_PARAMETERS`."""
        return tuple(name for name in LUMPED_PARAMETERS if getattr(self, name, None) is not None)

    @property
    def deviations(self) -> dict[str, float]:
        """The standard deviations of the logarithms of these parameters, by name."""
        return {name: math.log1p(getattr(self, name)) / DEVIATIONS for name in self.names}

    def without(self, names: tuple[str, ...]) -> Self | None:
        """Return the tolerances without those of `names`, None if no tolerance is left."""
        remaining = {name: getattr(self, name) for name in self.names if name not in names}
        return type(self)(**remaining) if remaining else None
