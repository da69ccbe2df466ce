"""A section of a description: frozen, closed to unknown keys, its numbers of a sensible magnitude."""

from collections.abc import Mapping
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, field_validator

from emaphm.errors import ActuatorError, nearest

SMALLEST, LARGEST = 1e-15, 1e15
"""Magnitudes that a quantity may have unless it is 0, in its SI unit: no actuator comes near, and products
and ratios of what lies within stay finite."""


class Section(BaseModel):
    """Frozen, and closed to unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy with the fields in `update`, which are not validated: see `Actuator.changed`.

        A name that is none of the fields' raises `ActuatorError`.
        """
        for name in update or {}:
            if name not in type(self).model_fields:
                raise ActuatorError(f"unknown key '{name}'{nearest(name, type(self).model_fields)}")
        return super().model_copy(update=update, deep=deep)

    @field_validator("*")
    @classmethod
    def _of_sensible_magnitude(cls, value: Any) -> Any:
        for number in value if isinstance(value, tuple) else (value,):
            if isinstance(number, float) and number and not SMALLEST <= abs(number) <= LARGEST:
                raise ValueError(
                    f"must be 0 or of a magnitude from {SMALLEST:g} to {LARGEST:g}, in its SI unit"
                )
        return value
