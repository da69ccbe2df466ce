"""The estimate of a nuisance or of a parameter of the unit."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from emaphm.estimation.space.nuisances import BASELINE


@dataclass(frozen=True)
class NuisanceEstimate:
    """A parameter estimated with the faults: a value and its standard error in `unit`.

    The value of a parameter of the unit is the deviation of its logarithm from the description, or in its own
    unit if it may have either sign (`emaphm.actuator.unit.baseline.SIGNED`).

    `known` is false where the channels hardly constrain the parameter, so that the prior determines it.
    """

    value: float
    standard_error: float
    unit: str
    known: bool

    def __str__(self) -> str:
        """Return the value with its standard error and unit."""
        unit = "" if self.unit == "-" else f" {self.unit}"
        # Value and error are rounded to the second digit of the error.
        digits = max(0, 1 - math.floor(math.log10(max(self.standard_error, 1e-12))))
        return f"{self.value:+z.{digits}f} ± {self.standard_error:.{digits}f}{unit}"

    def to_dict(self) -> dict[str, Any]:
        """Return the estimate, ready for `json.dumps`."""
        return asdict(self)


def of_unit(nuisances: Mapping[str, NuisanceEstimate]) -> dict[str, NuisanceEstimate]:
    """Return the parameters of the unit among `nuisances`, by name: all its recordings share them."""
    return {name: estimate for name, estimate in nuisances.items() if name.startswith(BASELINE)}
