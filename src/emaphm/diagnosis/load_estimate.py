"""The estimate of a load that varies over the recording, with its standard error."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.diagnosis.nuisance_estimate import NuisanceEstimate
from emaphm.simulation.laws.load_steps import STEP_PREFIX, step_load, step_names
from emaphm.simulation.laws.load_variation import PREFIX, spline_basis

CONSTANT = 3.0
"""Range of a load, in mean standard errors, up to which it counts as constant."""


@dataclass(frozen=True)
class LoadStep:
    """A step of a load: size, time of its middle [s from the first row], and rise time [s]."""

    size: float
    time_s: float
    rise_s: float


@dataclass(frozen=True, eq=False)
class LoadEstimate:
    """A load at the motor and its standard error, one value per row, without the share of the load stiffness.

    `steps` are the steps of a load that consists of a constant and steps; empty otherwise.
    """

    value: Array
    standard_error: Array
    unit: str
    steps: tuple[LoadStep, ...] = ()

    @property
    def is_constant(self) -> bool:
        """Whether the range of the load is within its standard errors."""
        return not self.steps and bool(np.ptp(self.value) <= CONSTANT * self.standard_error.mean())

    def __str__(self) -> str:
        """Return a description of the load as a predicate: "is …", "varies …" or "steps …"."""
        if self.is_constant:
            return f"is {self.value.mean():+.3g} {self.unit} throughout"
        if not self.steps:
            return f"varies from {self.value.min():+.3g} to {self.value.max():+.3g} {self.unit}"
        steps = (f"{step.size:+.3g} {self.unit} {1e3 * step.time_s:.4g} ms" for step in self.steps)
        return f"steps by {' and by '.join(steps)} after the start"


def is_of_load(name: str) -> bool:
    """Return whether a nuisance is part of a load that varies: the constant, a coefficient or a step."""
    return name == "load" or name.startswith((PREFIX, STEP_PREFIX))


def estimated_load(
    nuisances: Mapping[str, NuisanceEstimate], coordinates: Sequence[str], covariance: Array, time_s: Array
) -> LoadEstimate | None:
    """Return the load at the middle of each row; None if it was not estimated as varying.

    `covariance` is that of the `coordinates`, as in `Diagnosis`; `time_s` (rows,) are the rows' starts [s].
    """
    names = [name for name in coordinates if is_of_load(name)]
    if not names or names == ["load"]:
        return None
    interval = float(time_s[1] - time_s[0])
    value, derivatives = _load(nuisances, names, time_s - time_s[0] + interval / 2, interval)
    rows = [coordinates.index(name) for name in names]
    block = covariance[np.ix_(rows, rows)]
    errors = np.array([nuisances[name].standard_error for name in names])
    scaled = derivatives * (errors / np.sqrt(np.diag(block)))
    variance = np.sum((scaled @ block) * scaled, axis=1)
    return LoadEstimate(value, np.sqrt(variance), nuisances[names[0]].unit, _steps(nuisances, names))


def _load(
    nuisances: Mapping[str, NuisanceEstimate], names: Sequence[str], middles: Array, interval: float
) -> tuple[Array, Array]:
    """Return the load at the rows' `middles` (n,) [s] and its derivatives (n, names).

    Derivatives are finite differences over the standard errors: a load that jumps has no derivative with
    respect to a step's times.
    """
    values = {name: nuisances[name].value for name in names}
    coefficients = [name for name in names if name.startswith(PREFIX)]
    shares = (np.arange(middles.size) + 0.5) / middles.size
    basis = spline_basis(len(coefficients), shares) if coefficients else np.zeros((middles.size, 0))

    def at(given: Mapping[str, float]) -> Array:
        total: Array = given.get("load", 0.0) + basis @ np.array([given[name] for name in coefficients])
        for size, time, rise in _steps_of(names):
            total += step_load(given[size], given[time], given[rise], middles, interval)
        return total

    derivatives = np.empty((middles.size, len(names)))
    for i, name in enumerate(names):
        error = nuisances[name].standard_error
        up, down = (at({**values, name: values[name] + side * error}) for side in (1, -1))
        derivatives[:, i] = (up - down) / (2 * error)
    return at(values), derivatives


def _steps_of(names: Sequence[str]) -> list[tuple[str, str, str]]:
    """Return the names of size, time and rise time of each step among `names`."""
    candidates = (step_names(i + 1) for i in range(len(names)))
    return [parts for parts in candidates if parts[0] in names]


def _steps(nuisances: Mapping[str, NuisanceEstimate], names: Sequence[str]) -> tuple[LoadStep, ...]:
    """Return the steps, in order of time, of a load that consists of a constant and steps."""
    if any(name.startswith(PREFIX) for name in names):
        return ()
    values = [tuple(nuisances[part].value for part in parts) for parts in _steps_of(names)]
    # The rise time of an instantaneous step may be estimated slightly below 0, which acts as 0.
    steps = [LoadStep(size, time, max(rise, 0.0)) for size, time, rise in values]
    return tuple(sorted(steps, key=lambda step: step.time_s))
