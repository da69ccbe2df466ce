"""Base class of the sections of a description: immutable, without unknown keys, with plausible numbers."""

from collections.abc import Mapping
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, field_validator

from emaphm.errors import ActuatorError, nearest

SMALLEST, LARGEST = 1e-15, 1e15
"""Range of the magnitude of a quantity that is not 0, in its SI unit: no actuator comes near these limits,
and products and ratios of values within them stay finite."""


class Section(BaseModel):
    """Base class of sections: immutable, and unknown keys are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy with the fields in `update`, which are not validated; `Actuator.changed` validates.

        A name that is not a field raises `ActuatorError`.
        """
        for name in update or {}:
            if name not in type(self).model_fields:
                raise ActuatorError(f"unknown key '{name}'{nearest(name, type(self).model_fields)}")
        return super().model_copy(update=update, deep=deep)

    @field_validator("*")
    @classmethod
    def _check_magnitude(cls, value: Any) -> Any:
        for number in value if isinstance(value, tuple) else (value,):
            if isinstance(number, float) and number and not SMALLEST <= abs(number) <= LARGEST:
                raise ValueError(
                    f"must be 0 or of a magnitude from {SMALLEST:g} to {LARGEST:g}, in its SI unit"
                )
        return value
