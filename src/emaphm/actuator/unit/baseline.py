"""The lumped parameters that a calibration estimates, and the baseline, their covariance."""

from typing import Annotated, Self

import numpy as np
from pydantic import Field, ValidationInfo, field_validator

from emaphm.actuator.quantity import ELECTRICAL_ANGLE, USER_ANGLE, quantity
from emaphm.actuator.section import LARGEST, SMALLEST, Section
from emaphm.errors import nearest

MOST_HARMONICS = 8
"""Largest number of harmonics of the torque ripple."""

HALL_SENSORS = ("hall_a", "hall_b", "hall_c")
COMMUTATION = ("commutation_lag", "commutation_delay")

LUMPED_PARAMETERS = {
    "inertia": "kg·m²",
    "viscous": "N·m·s/rad",
    "coulomb": "N·m",
    "static": "N·m",
    "offset": "N·m",
    "hinge": f"N·m/{USER_ANGLE}",
    "backlash": "rad",
    "position_gain": f"rad/(s·{USER_ANGLE})",
    "position_integral_gain": "1/s",
    "position_derivative_gain": "s",
    "speed_gain": "N·m·s/rad",
    "integral_gain": "N·m/rad",
    "derivative_gain": "N·m·s²/rad",
    "command_lag": "s",
    "speed_feedforward": "-",
    "speed_feedback": "-",
    "speed_lag": "s",
    "torque_constant": "N·m/A",
    "saturation": "1/A",
    "flat_loss": ELECTRICAL_ANGLE,
    "sine_share": "-",
    **dict.fromkeys(HALL_SENSORS, ELECTRICAL_ANGLE),
    "torque_lag": "s",
    "resistance": "ohm",
    "inductance": "H",
    "rotor_zero": ELECTRICAL_ANGLE,
    "supply": "V",
    "temperature_gain": "-",
    "current_gain": "V/A",
    "current_integral_gain": "V/(A·s)",
    "source_resistance": "ohm",
    "voltage_drop": "V",
    "current_lag": "s",
    "commutation_lag": ELECTRICAL_ANGLE,
    "commutation_delay": "s",
    "stribeck_speed": "rad/s",
    "load_friction": "-",
    "load_motor": "-",
    "load_external": "-",
    "stribeck_load_motor": "-",
    "stribeck_load_external": "-",
    "coulomb_asymmetry": "-",
    "viscous_asymmetry": "-",
    "quadratic": "N·m·s²/rad²",
    "transition_speed": "rad/s",
    "presliding_stiffness": "N·m/rad",
    "presliding_damping": "N·m·s/rad",
    "viscous_temperature": "1/K",
    "stiffness": "N·m/rad",
    "damping": "N·m·s/rad",
    "gravity": "N·m",
    "gravity_angle": "rad",
    **{f"ripple{i + 1}_{part}": "N·m" for i in range(MOST_HARMONICS) for part in ("cos", "sin")},
}
"""Units by name; coulomb is dynamic friction, offset a constant load, hinge the load stiffness."""

SUMS = {
    "inertia": ("mechanics", "inertia_motor", "inertia_user"),
    "viscous": ("mechanics", "viscous_motor", "viscous_user"),
    "coulomb": ("mechanics", "dynamic_friction_motor", "dynamic_friction_user"),
    "static": ("mechanics", "static_friction_motor", "static_friction_user"),
}

SECTIONS = {
    "mechanics": ("offset", "hinge", "backlash"),
    "controller": (
        "position_gain",
        "position_integral_gain",
        "position_derivative_gain",
        "speed_gain",
        "integral_gain",
        "derivative_gain",
        "command_lag",
        "speed_feedforward",
        "speed_feedback",
        "speed_lag",
    ),
    "motor": (
        "torque_constant",
        "saturation",
        "flat_loss",
        "sine_share",
        *HALL_SENSORS,
        "torque_lag",
    ),
    "electrical": ("resistance", "inductance", "rotor_zero", "supply", "temperature_gain"),
    "drive": (
        "current_gain",
        "current_integral_gain",
        "source_resistance",
        "voltage_drop",
        "current_lag",
        *COMMUTATION,
    ),
    "friction": (
        "stribeck_speed",
        "load_friction",
        "load_motor",
        "load_external",
        "stribeck_load_motor",
        "stribeck_load_external",
        "coulomb_asymmetry",
        "viscous_asymmetry",
        "quadratic",
        "transition_speed",
        "presliding_stiffness",
        "presliding_damping",
        "viscous_temperature",
    ),
    "transmission": ("stiffness", "damping"),
    "weight": ("gravity", "gravity_angle"),
}

PARTS: dict[str, tuple[str, ...]] = {
    **SUMS,
    **{name: (section, name) for section, names in SECTIONS.items() for name in names},
    **{
        name: ("ripple", *name.removeprefix("ripple").split("_"))
        for name in LUMPED_PARAMETERS
        if "ripple" in name
    },
}
"""Place of each parameter in the description: its section, then the fields whose sum it is; for a harmonic of
the ripple, its place in the list and its field."""

SIGNED = (
    "offset",
    "coulomb_asymmetry",
    "viscous_asymmetry",
    "gravity_angle",
    "rotor_zero",
    "saturation",
    "sine_share",
    *HALL_SENSORS,
    *COMMUTATION,
    *(name for name in LUMPED_PARAMETERS if name.startswith("ripple")),
)
"""Parameters of either sign: their covariance is in their own unit, that of the other parameters relative."""

ROUNDING = 1e-9
"""Largest asymmetry and negative eigenvalue of a correlation matrix that count as rounding."""

Number = Annotated[float, Field(strict=True)]


class Baseline(Section):
    """Covariance of one unit's parameters after its calibration, the prior of later diagnoses.

    Deviations of the lumped parameters `names` from the description are normal about 0 with `covariance`,
    (names, names): relative (of the logarithm) for positive parameters, in their own unit for parameters of
    either sign. They were estimated from `recordings`, whose mean loads, including the described load, are
    `loads`.
    """

    names: tuple[str, ...] = Field(description="calibrated parameters", min_length=1)
    covariance: tuple[tuple[Number, ...], ...] = quantity(
        "covariance of their deviations, of the logarithm; in its own unit for those of either sign",
        "-",
        "calibration",
        strict=False,
    )
    recordings: tuple[str, ...] = Field(description="recordings of the healthy unit", min_length=1)
    loads: tuple[Number, ...] = quantity(
        "mean load of each, recorded or estimated", "N·m", "calibration", default=(), strict=False
    )

    @field_validator("names")
    @classmethod
    def _check_names(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        for name in names:
            if name not in LUMPED_PARAMETERS:
                raise ValueError(f"unknown parameter '{name}'{nearest(name, LUMPED_PARAMETERS)}")
            if names.count(name) > 1:
                raise ValueError(f"parameter '{name}' is named twice; name it once")
        return names

    @field_validator("covariance")
    @classmethod
    def _check_covariance(
        cls, rows: tuple[tuple[float, ...], ...], info: ValidationInfo
    ) -> tuple[tuple[float, ...], ...]:
        count = len(info.data.get("names", rows))
        if len(rows) != count or any(len(row) != count for row in rows):
            sizes = " and ".join(sorted({str(len(row)) for row in rows})) or "no"
            raise ValueError(
                f"must have a row and a column for each of {count} names, has {len(rows)} rows of {sizes}"
            )
        too_large = [value for row in rows for value in row if abs(value) > LARGEST]
        if too_large:
            raise ValueError(f"must have values of {LARGEST:g} at most, has {too_large[0]:g}")
        # Checked as a correlation matrix, because variances may differ by many orders of magnitude.
        deviations = np.sqrt(np.maximum(np.diag(rows), 0.0))
        unit = np.where(deviations > SMALLEST, deviations, 1.0)
        matrix = np.array(rows) / np.outer(unit, unit)
        asymmetric = np.argwhere(np.abs(matrix - matrix.T) > ROUNDING)
        if asymmetric.size:
            i, j = asymmetric[0] + 1
            raise ValueError(f"must be symmetric; row {i}, column {j} differs from row {j}, column {i}")
        if np.diag(rows).min() < 0 or np.linalg.eigvalsh(matrix)[0] < -ROUNDING:
            raise ValueError(
                "must be positive semidefinite; some combination of the names has a variance below 0"
            )
        return rows

    @property
    def deviations(self) -> dict[str, float]:
        """The standard deviation of each parameter, in the units of `covariance`."""
        return dict(zip(self.names, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    @classmethod
    def of(
        cls,
        names: tuple[str, ...],
        covariance: object,
        recordings: tuple[str, ...],
        loads: tuple[float, ...] = (),
    ) -> Self:
        """Return the baseline with a covariance given as an array (names, names)."""
        rows = tuple(tuple(float(value) for value in row) for row in np.asarray(covariance, float))
        return cls(names=names, covariance=rows, recordings=recordings, loads=loads)
