"""The load that a diagnosis has estimated over the recording, where it varies."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.diagnosis.nuisance_estimate import NuisanceEstimate
from emaphm.simulation.laws.load_variation import PREFIX, spline_basis


@dataclass(frozen=True, eq=False)
class LoadEstimate:
    """A load at the motor and its standard error, a value a row; less what rises with the position."""

    value: Array
    standard_error: Array
    unit: str

    def __str__(self) -> str:
        """Return between what it varies, in words."""
        return f"from {self.value.min():+.3g} to {self.value.max():+.3g} {self.unit}"


def is_of_load(name: str) -> bool:
    """Return whether a nuisance is a part of a load that varies: its constant part, or a coefficient."""
    return name == "load" or name.startswith(PREFIX)


def estimated_load(
    nuisances: Mapping[str, NuisanceEstimate], coordinates: Sequence[str], covariance: Array, samples: int
) -> LoadEstimate | None:
    """Return the load at the middle of each of `samples` rows; None where it was not estimated as varying.

    `covariance` is that of the `coordinates`, as in `Diagnosis`.
    """
    names = [name for name in coordinates if name.startswith(PREFIX)]
    if not names:
        return None
    basis = spline_basis(len(names), (np.arange(samples) + 0.5) / samples)
    if "load" in nuisances:
        names, basis = ["load", *names], np.column_stack([np.ones(samples), basis])
    rows = [coordinates.index(name) for name in names]
    own = covariance[np.ix_(rows, rows)]
    errors = np.array([nuisances[name].standard_error for name in names])
    units = errors / np.sqrt(np.diag(own))
    scaled = basis * units
    variance = np.sum((scaled @ own) * scaled, axis=1)
    value = basis @ np.array([nuisances[name].value for name in names])
    return LoadEstimate(np.asarray(value), np.sqrt(variance), nuisances[names[0]].unit)
