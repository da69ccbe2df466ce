"""What spoils a recording: each a function from columns to columns, or from an actuator to a wrong one.

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
"""From the columns, and random numbers of its own, to the spoilt columns."""

WrongActuator = Callable[[Actuator], Actuator]
"""From the true description to a wrong one."""

GIVEN = ("time_s", "command_rad")


def unchanged(columns: Columns, _rng: np.random.Generator) -> Columns:
    """Return the columns as they are."""
    return columns


def linear(name: str, factor: float = 1.0, offset: float = 0.0) -> Change:
    """Return what multiplies a column by `factor` and adds `offset`, in its unit."""
    return lambda columns, _: {**columns, name: factor * columns[name] + offset}


def every(names: tuple[str, ...], factor: float) -> Change:
    """Return what multiplies those of the columns `names` that were recorded by `factor`."""
    return lambda columns, _: {
        name: factor * values if name in names else values for name, values in columns.items()
    }


def constant(name: str, value: float | None = None) -> Change:
    """Return what holds a column at `value`, or at its first value."""
    return lambda columns, _: {
        **columns,
        name: np.full_like(columns[name], columns[name][0] if value is None else value),
    }


def added(name: str, value: float) -> Change:
    """Return what adds a column of one `value`: a quantity recorded as known."""
    return lambda columns, _: {**columns, name: np.full_like(columns["time_s"], value)}


def white(name: str, rms: float) -> Change:
    """Return what replaces a column by white noise of that `rms`, in its unit."""
    return lambda columns, rng: {**columns, name: rng.normal(0.0, rms, columns[name].size)}


def noisier(name: str, rms: float) -> Change:
    """Return what adds white noise of that `rms` to a column, in its unit."""
    return lambda columns, rng: {**columns, name: columns[name] + rng.normal(0.0, rms, columns[name].size)}


def late(rows: int, names: tuple[str, ...] | None = None) -> Change:
    """Return what shifts columns by `rows` later, or earlier where negative; the end values are held.

    All sensed columns where `names` are left out.
    """

    def shift(columns: Columns, _: np.random.Generator) -> Columns:
        moved = names if names is not None else tuple(name for name in columns if name not in GIVEN)
        size = columns["time_s"].size
        rows_taken = np.clip(np.arange(size) - rows, 0, size - 1)
        return {name: values[rows_taken] if name in moved else values for name, values in columns.items()}

    return shift


def exchanged(names: tuple[str, ...], others: tuple[str, ...]) -> Change:
    """Return what puts the columns `others` in place of `names`, in that order."""
    return lambda columns, _: {
        **columns,
        **{name: columns[other] for name, other in zip(names, others, strict=True)},
    }


def spikes(name: str, size: float, count: int) -> Change:
    """Return what replaces `count` values of a column by `size`, of random sign."""

    def spike(columns: Columns, rng: np.random.Generator) -> Columns:
        values = columns[name].copy()
        values[rng.choice(values.size, count, replace=False)] = size * rng.choice([-1.0, 1.0], count)
        return {**columns, name: values}

    return spike


def clipped(name: str, share: float) -> Change:
    """Return what clips a column at that `share` of its largest magnitude."""

    def clip(columns: Columns, _: np.random.Generator) -> Columns:
        most = share * float(np.abs(columns[name]).max())
        return {**columns, name: np.clip(columns[name], -most, most)}

    return clip


def frozen(name: str, start: float) -> Change:
    """Return what holds a column from the share `start` of the recording on."""

    def freeze(columns: Columns, _: np.random.Generator) -> Columns:
        values = columns[name].copy()
        first = int(start * values.size)
        values[first:] = values[first]
        return {**columns, name: values}

    return freeze


def held(name: str, rows: int) -> Change:
    """Return what holds each value of a column for `rows` rows, as a slow sensor between its samples."""
    return lambda columns, _: {**columns, name: np.repeat(columns[name][::rows], rows)[: columns[name].size]}


def dropped(name: str, start: float, end: float) -> Change:
    """Return what sets a column to 0 between two shares of the recording."""

    def drop(columns: Columns, _: np.random.Generator) -> Columns:
        values = columns[name].copy()
        values[int(start * values.size) : int(end * values.size)] = 0.0
        return {**columns, name: values}

    return drop


def rectified(name: str) -> Change:
    """Return what takes the magnitude of a column."""
    return lambda columns, _: {**columns, name: np.abs(columns[name])}


def lagging(name: str, time_constant: float) -> Change:
    """Return what passes a column through a low-pass of first order, with that `time_constant` [s]."""

    def lag(columns: Columns, _: np.random.Generator) -> Columns:
        interval = float(columns["time_s"][1] - columns["time_s"][0])
        share = -float(np.expm1(-interval / time_constant))
        shown, value = np.empty_like(columns[name]), float(columns[name][0])
        for row, present in enumerate(columns[name]):
            value += share * (float(present) - value)
            shown[row] = value
        return {**columns, name: shown}

    return lag


def hum(name: str, amplitude: float, frequency: float) -> Change:
    """Return what adds a sine of an `amplitude`, in the column's unit, and a `frequency` [Hz]."""
    return lambda columns, _: {
        **columns,
        name: columns[name] + amplitude * np.sin(2 * np.pi * frequency * columns["time_s"]),
    }


def drifting(name: str, total: float) -> Change:
    """Return what adds a ramp from 0 to `total`, in the column's unit."""
    return lambda columns, _: {**columns, name: columns[name] + np.linspace(0.0, total, columns[name].size)}


def described_with(section: str, **factors: float) -> WrongActuator:
    """Return what multiplies parameters of a section of the description by `factors`."""

    def change(actuator: Actuator) -> Actuator:
        part = getattr(actuator, section)
        # Whole numbers stay whole, as the description asks.
        values = {name: type(getattr(part, name))(getattr(part, name) * f) for name, f in factors.items()}
        return actuator.model_copy(update={section: part.model_copy(update=values)})

    return change


def described_at(**values: float) -> WrongActuator:
    """Return what sets lumped parameters of the description to `values`."""
    return lambda actuator: with_lumped_parameters(actuator, values)


def with_tolerances(described: WrongActuator, **tolerances: float) -> WrongActuator:
    """Return what states tolerances of lumped parameters in what `described` makes of the description."""
    return lambda actuator: described(actuator).model_copy(update={"tolerances": Tolerances(**tolerances)})
