"""Changes that spoil a recording or its description: functions of the columns, or of the actuator.

Columns are arrays (n,) by name, in SI units. None of the functions changes its arguments.
"""

from collections.abc import Callable, Mapping

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.actuator.unit.tolerances import Tolerances
from emaphm.arrays import Array

Columns = Mapping[str, Array]
Change = Callable[[Columns, np.random.Generator], Columns]
"""Function of the columns and a random generator that returns the spoilt columns."""

WrongActuator = Callable[[Actuator], Actuator]
"""Function of the true description that returns a wrong description."""

GIVEN = ("time_s", "command_rad")


def unchanged(columns: Columns, _rng: np.random.Generator) -> Columns:
    """Return the columns unchanged."""
    return columns


def linear(name: str, factor: float = 1.0, offset: float = 0.0) -> Change:
    """Return a change that multiplies a column by `factor` and adds `offset`, in its unit."""
    return lambda columns, _: {**columns, name: factor * columns[name] + offset}


def scaled(names: tuple[str, ...], factor: float) -> Change:
    """Return a change that multiplies the columns `names`, if they were recorded, by `factor`."""
    return lambda columns, _: {
        name: factor * values if name in names else values for name, values in columns.items()
    }


def constant(name: str, value: float | None = None) -> Change:
    """Return a change that sets a column to `value`, or to its first value."""
    return lambda columns, _: {
        **columns,
        name: np.full_like(columns[name], columns[name][0] if value is None else value),
    }


def added(name: str, value: float) -> Change:
    """Return a change that adds a column with a constant `value`: a quantity recorded as known."""
    return lambda columns, _: {**columns, name: np.full_like(columns["time_s"], value)}


def white(name: str, rms: float) -> Change:
    """Return a change that replaces a column by white noise of this `rms`, in its unit."""
    return lambda columns, rng: {**columns, name: rng.normal(0.0, rms, columns[name].size)}


def noisier(name: str, rms: float) -> Change:
    """Return a change that adds white noise of this `rms` to a column, in its unit."""
    return lambda columns, rng: {**columns, name: columns[name] + rng.normal(0.0, rms, columns[name].size)}


def late(rows: int, names: tuple[str, ...] | None = None) -> Change:
    """Return a change that delays columns by `rows`, or advances them if negative; end values are held.

    By default, all sensed columns.
    """

    def shift(columns: Columns, _: np.random.Generator) -> Columns:
        moved = names if names is not None else tuple(name for name in columns if name not in GIVEN)
        size = columns["time_s"].size
        rows_taken = np.clip(np.arange(size) - rows, 0, size - 1)
        return {name: values[rows_taken] if name in moved else values for name, values in columns.items()}

    return shift


def exchanged(names: tuple[str, ...], others: tuple[str, ...]) -> Change:
    """Return a change that puts the columns `others` in place of `names`, in that order."""
    return lambda columns, _: {
        **columns,
        **{name: columns[other] for name, other in zip(names, others, strict=True)},
    }


def spikes(name: str, size: float, count: int) -> Change:
    """Return a change that replaces `count` values of a column by `size`, of random sign."""

    def spike(columns: Columns, rng: np.random.Generator) -> Columns:
        values = columns[name].copy()
        values[rng.choice(values.size, count, replace=False)] = size * rng.choice([-1.0, 1.0], count)
        return {**columns, name: values}

    return spike


def clipped(name: str, share: float) -> Change:
    """Return a change that clips a column at this `share` of its largest magnitude."""

    def clip(columns: Columns, _: np.random.Generator) -> Columns:
        limit = share * float(np.abs(columns[name]).max())
        return {**columns, name: np.clip(columns[name], -limit, limit)}

    return clip


def frozen(name: str, start: float) -> Change:
    """Return a change that holds a column from the share `start` of the recording on."""

    def freeze(columns: Columns, _: np.random.Generator) -> Columns:
        values = columns[name].copy()
        first = int(start * values.size)
        values[first:] = values[first]
        return {**columns, name: values}

    return freeze


def held(name: str, rows: int) -> Change:
    """Return a change that holds each value of a column for `rows` rows, like a sensor with a lower rate."""
    return lambda columns, _: {**columns, name: np.repeat(columns[name][::rows], rows)[: columns[name].size]}


def dropped(name: str, start: float, end: float) -> Change:
    """Return a change that sets a column to 0 between two shares of the recording."""

    def drop(columns: Columns, _: np.random.Generator) -> Columns:
        values = columns[name].copy()
        values[int(start * values.size) : int(end * values.size)] = 0.0
        return {**columns, name: values}

    return drop


def rectified(name: str) -> Change:
    """Return a change that takes the magnitude of a column."""
    return lambda columns, _: {**columns, name: np.abs(columns[name])}


def lagging(name: str, time_constant: float) -> Change:
    """Return a change that filters a column by a first-order low-pass with this `time_constant` [s]."""

    def lag(columns: Columns, _: np.random.Generator) -> Columns:
        interval = float(columns["time_s"][1] - columns["time_s"][0])
        share = -float(np.expm1(-interval / time_constant))
        filtered, value = np.empty_like(columns[name]), float(columns[name][0])
        for row, present in enumerate(columns[name]):
            value += share * (float(present) - value)
            filtered[row] = value
        return {**columns, name: filtered}

    return lag


def hum(name: str, amplitude: float, frequency: float) -> Change:
    """Return a change that adds a sine with an `amplitude`, in the column's unit, and a `frequency` [Hz]."""
    return lambda columns, _: {
        **columns,
        name: columns[name] + amplitude * np.sin(2 * np.pi * frequency * columns["time_s"]),
    }


def drifting(name: str, total: float) -> Change:
    """Return a change that adds a ramp from 0 to `total`, in the column's unit."""
    return lambda columns, _: {**columns, name: columns[name] + np.linspace(0.0, total, columns[name].size)}


def described_with(section: str, **factors: float) -> WrongActuator:
    """Return a function that multiplies parameters of a section of the description by `factors`."""

    def change(actuator: Actuator) -> Actuator:
        part = getattr(actuator, section)
        # Whole numbers stay whole, as the description requires.
        values = {name: type(getattr(part, name))(getattr(part, name) * f) for name, f in factors.items()}
        return actuator.model_copy(update={section: part.model_copy(update=values)})

    return change


def described_at(**values: float) -> WrongActuator:
    """Return a function that sets lumped parameters of the description to `values`."""
    return lambda actuator: with_lumped_parameters(actuator, values)


def with_tolerances(described: WrongActuator, **tolerances: float) -> WrongActuator:
    """Return a function that applies `described`, and then states tolerances of lumped parameters."""
    return lambda actuator: described(actuator).model_copy(update={"tolerances": Tolerances(**tolerances)})
