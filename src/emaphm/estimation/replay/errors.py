"""How far a modelled signal is from the measured one, in the channel's unit and relative to its size."""

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
"""Relative error above which a model that does nothing would be nearer: something other than the fit is
wrong."""


@dataclass(frozen=True)
class ErrorStatistics:
    """Mean absolute and rms error of a channel, in its unit, and the rms error relative to the measured rms.

    Of a position, the measured rms is that of its distance from where it starts. `relative` is None where it
    is 0: nothing to be relative to.
    """

    mean_absolute: float
    rms: float
    relative: float | None

    @classmethod
    def of(cls, name: str, pairs: Sequence[tuple[Array, Array]]) -> "ErrorStatistics":
        """Return the error of channel `name` over all rows of `pairs` of measured and modelled signals."""
        differences = np.concatenate([difference(name, one, other) for one, other in pairs])
        size = np.hypot.reduce([len(one) ** 0.5 * signal_size(name, one) for one, _ in pairs])
        relative = rms(differences) / (size / len(differences) ** 0.5) if size else None
        return cls(float(np.mean(np.abs(differences))), rms(differences), relative)


def difference(name: str, measured: Array, modelled: Array) -> Array:
    """Return measured less modelled, (samples,); angles are compared modulo a turn."""
    return wrap(measured - modelled) if name == "angle_rad" else measured - modelled


def relative_of(errors: Mapping[str, ErrorStatistics]) -> dict[str, float]:
    """Return the relative errors that are defined, by channel."""
    return {name: one.relative for name, one in errors.items() if one.relative is not None}


def warnings(errors: Mapping[str, ErrorStatistics]) -> tuple[str, ...]:
    """Return a sentence on each channel that the model is nothing like."""
    return tuple(
        f"{name} is off by {100 * error:.3g} % of its rms, more than from a model that does nothing: check "
        "its unit, its sign, its name under [channels], and the actuator's description"
        for name, error in relative_of(errors).items()
        if error > NO_LIKENESS
    )


def error_table(errors: Mapping[str, ErrorStatistics], coordinates: str) -> str:
    """Return the errors as a table of text, with units."""
    rows = [
        (
            name,
            f"{one.mean_absolute:.4g}",
            f"{one.rms:.4g}",
            unit_for(SCHEMA[name].unit, coordinates),
            NOTHING if one.relative is None else f"{100 * one.relative:.4g} %",
        )
        for name, one in errors.items()
    ]
    return format_table(("channel", "mean abs. error", "rms error", "unit", "relative error"), rows)
