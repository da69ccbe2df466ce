"""The estimate of a parameter that is no fault."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from emaphm.estimation.space.nuisances import BASELINE


@dataclass(frozen=True)
class NuisanceEstimate:
    """A parameter estimated with the faults: a value and its standard error in `unit`.

    A deviation of the unit from its description is one of the logarithm, unless the parameter may have either
    sign (`emaphm.actuator.unit.baseline.SIGNED`).

    `known` is false where the channels have next to no information on it, so that its prior is all there is.
    """

    value: float
    standard_error: float
    unit: str
    known: bool

    def __str__(self) -> str:
        """Return the value with its standard error and unit."""
        unit = "" if self.unit == "-" else f" {self.unit}"
        # Both to the second digit of the error.
        digits = max(0, 1 - math.floor(math.log10(max(self.standard_error, 1e-12))))
        return f"{self.value:+z.{digits}f} ± {self.standard_error:.{digits}f}{unit}"

    def to_dict(self) -> dict[str, Any]:
        """Return the estimate, ready for `json.dumps`."""
        return asdict(self)


def of_unit(nuisances: Mapping[str, NuisanceEstimate]) -> dict[str, NuisanceEstimate]:
    """Return those of `nuisances` by name that are the unit's, common to all of its recordings."""
    return {name: one for name, one in nuisances.items() if name.startswith(BASELINE)}
