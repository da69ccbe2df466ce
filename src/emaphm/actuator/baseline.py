"""The lumped parameters that a calibration estimates, and how well they are known: the baseline."""

from typing import Annotated, Self

import numpy as np
from pydantic import Field, ValidationInfo, field_validator

from emaphm.actuator.parameters import LARGEST, SMALLEST, Section
from emaphm.actuator.quantity import quantity
from emaphm.errors import nearest

LUMPED_PARAMETERS = {
    "inertia": "kg·m²",
    "viscous": "N·m·s/rad",
    "coulomb": "N·m",
    "static": "N·m",
    "offset": "N·m",
    "hinge": "N·m/rad",
    "position_gain": "1/s",
    "speed_gain": "N·m·s/rad",
    "speed_lag": "s",
    "torque_constant": "N·m/A",
    "torque_lag": "s",
    "resistance": "ohm",
    "inductance": "H",
    "supply": "V",
}
"""Names and units: coulomb is dynamic friction, offset a constant load, hinge the load stiffness."""

PARTS = {
    "inertia": ("mechanics", "inertia_motor", "inertia_user"),
    "viscous": ("mechanics", "viscous_motor", "viscous_user"),
    "coulomb": ("mechanics", "dynamic_friction_motor", "dynamic_friction_user"),
    "static": ("mechanics", "static_friction_motor", "static_friction_user"),
    "offset": ("mechanics", "offset"),
    "hinge": ("mechanics", "hinge"),
    "position_gain": ("controller", "position_gain"),
    "speed_gain": ("controller", "speed_gain"),
    "speed_lag": ("controller", "speed_lag"),
    "torque_constant": ("motor", "torque_constant"),
    "torque_lag": ("motor", "torque_lag"),
    "resistance": ("electrical", "resistance"),
    "inductance": ("electrical", "inductance"),
    "supply": ("electrical", "supply"),
}
"""Where each parameter stands in the description: its section, then the fields that it is the sum of."""

LINEAR = ("offset",)
"""Parameters of either sign: their covariance is in their own unit, that of the others relative."""

ROUNDING = 1e-9
"""Asymmetry, and negative eigenvalues, that a covariance may have from rounding, as a correlation."""

Number = Annotated[float, Field(strict=True)]


class Baseline(Section):
    """How well one unit's parameters are known after its calibration: the prior of later diagnoses.

    Deviations of the lumped parameters `names` from the description are normal about 0 with `covariance`,
    (names, names): relative (of the logarithm) for positive parameters, in its own unit for the offset. They
    were estimated from `recordings`.
    """

    names: tuple[str, ...] = Field(description="calibrated parameters", min_length=1)
    covariance: tuple[tuple[Number, ...], ...] = quantity(
        "covariance of their deviations, of the logarithm; of an offset in its own unit",
        "-",
        "calibration",
        strict=False,
    )
    recordings: tuple[str, ...] = Field(description="recordings of the healthy unit", min_length=1)

    @field_validator("names")
    @classmethod
    def _known(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        for name in names:
            if name not in LUMPED_PARAMETERS:
                raise ValueError(f"unknown parameter '{name}'{nearest(name, LUMPED_PARAMETERS)}")
            if names.count(name) > 1:
                raise ValueError(f"parameter '{name}' is named twice; name it once")
        return names

    @field_validator("covariance")
    @classmethod
    def _possible(
        cls, rows: tuple[tuple[float, ...], ...], info: ValidationInfo
    ) -> tuple[tuple[float, ...], ...]:
        count = len(info.data.get("names", rows))
        if len(rows) != count or any(len(row) != count for row in rows):
            sizes = " and ".join(sorted({str(len(row)) for row in rows})) or "no"
            raise ValueError(
                f"must have a row and a column for each of {count} names, has {len(rows)} rows of {sizes}"
            )
        wide = [value for row in rows for value in row if abs(value) > LARGEST]
        if wide:
            raise ValueError(f"must have values of {LARGEST:g} at most, has {wide[0]:g}")
        # Each in units of its own deviation: they may be of very different sizes.
        deviations = np.sqrt(np.maximum(np.diag(rows), 0.0))
        unit = np.where(deviations > SMALLEST, deviations, 1.0)
        matrix = np.array(rows) / np.outer(unit, unit)
        uneven = np.argwhere(np.abs(matrix - matrix.T) > ROUNDING)
        if uneven.size:
            i, j = uneven[0] + 1
            raise ValueError(f"must be symmetric; row {i}, column {j} differs from row {j}, column {i}")
        if np.diag(rows).min() < 0 or np.linalg.eigvalsh(matrix)[0] < -ROUNDING:
            raise ValueError(
                "must be positive semidefinite; some combination of the names has a variance below 0"
            )
        return rows

    @classmethod
    def of(cls, names: tuple[str, ...], covariance: object, recordings: tuple[str, ...]) -> Self:
        """Return the baseline with a covariance given as an array (names, names)."""
        rows = tuple(tuple(float(value) for value in row) for row in np.asarray(covariance, float))
        return cls(names=names, covariance=rows, recordings=recordings)
