"""Error of a modelled signal relative to the measured one, in the channel's unit and as a fraction."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from emaphm.actuator.quantity import unit_for
from emaphm.arrays import Array, rms
from emaphm.estimation.signal_size import signal_size
from emaphm.recording.schema import SCHEMA
from emaphm.simulation.laws.angles import wrap
from emaphm.text_table import NOTHING, format_table

NO_LIKENESS = 1.0
"""Relative error above which a model at rest would be better: the cause is then not the fit."""


@dataclass(frozen=True)
class ErrorStatistics:
    """Mean absolute and rms error of a channel, in its unit, and the rms error relative to the measured rms.

    For a position, the measured rms is that of its distance from its first value. `relative` is None if the
    measured rms is 0.
    """

    mean_absolute: float
    rms: float
    relative: float | None

    @classmethod
    def of(cls, name: str, pairs: Sequence[tuple[Array, Array]]) -> "ErrorStatistics":
        """Return the error of channel `name` over all rows of `pairs` of measured and modelled signals."""
        differences = np.concatenate([difference(name, measured, modelled) for measured, modelled in pairs])
        size = np.hypot.reduce([len(measured) ** 0.5 * signal_size(name, measured) for measured, _ in pairs])
        relative = rms(differences) / (size / len(differences) ** 0.5) if size else None
        return cls(float(np.mean(np.abs(differences))), rms(differences), relative)


def difference(name: str, measured: Array, modelled: Array) -> Array:
    """Return measured minus modelled, (samples,); angles are compared modulo a turn."""
    return wrap(measured - modelled) if name == "angle_rad" else measured - modelled


def relative_of(errors: Mapping[str, ErrorStatistics]) -> dict[str, float]:
    """Return the relative errors that are defined, by channel."""
    return {name: error.relative for name, error in errors.items() if error.relative is not None}


def warnings(errors: Mapping[str, ErrorStatistics]) -> tuple[str, ...]:
    """Return a sentence on each channel with a relative error above `NO_LIKENESS`."""
    return tuple(
        f"{name} deviates by {100 * error:.3g} % of its rms, more than the error of a model at rest: check "
        "its unit, its sign, its name under [channels], and the actuator's description"
        for name, error in relative_of(errors).items()
        if error > NO_LIKENESS
    )


def error_table(errors: Mapping[str, ErrorStatistics], coordinates: str) -> str:
    """Return the errors as a table of text, with units."""
    rows = [
        (
            name,
            f"{error.mean_absolute:.4g}",
            f"{error.rms:.4g}",
            unit_for(SCHEMA[name].unit, coordinates),
            NOTHING if error.relative is None else f"{100 * error.relative:.4g} %",
        )
        for name, error in errors.items()
    ]
    return format_table(("channel", "mean abs. error", "rms error", "unit", "relative error"), rows)
