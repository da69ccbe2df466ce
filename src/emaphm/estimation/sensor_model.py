"""What the sensors make of a model's signals: scale and offset errors of the channels that have them."""

from collections.abc import Mapping, Sequence

import numpy as np

from emaphm.arrays import Array

SCALE_ERRORS = {"current_scale": "current_A"}
"""Nuisances that are a relative error of a channel's scale, by the channel that they act on."""

OFFSET_ERRORS = {"current_offset": "current_A"}
"""Nuisances that are an error of a channel's zero, in its unit, by the channel that they act on."""


def as_sensed(signals: Array, channels: Sequence[str], nuisances: Mapping[str, Array]) -> Array:
    """Return a model's signals as the sensors show them: y = (1 + s) x + o.

    Parameters
    ----------
    signals
        Of the `channels`, shape (n, channels, samples), each in its unit; changed in place.
    nuisances
        Values (n,) by name; those without a sensor error here are left out.
    """
    for names, act in ((SCALE_ERRORS, _scale), (OFFSET_ERRORS, _shift)):
        for name, channel in names.items():
            if name in nuisances and channel in channels:
                act(signals[:, channels.index(channel)], nuisances[name][:, np.newaxis])
    return signals


def _scale(signal: Array, error: Array) -> None:
    signal *= 1 + error


def _shift(signal: Array, error: Array) -> None:
    signal += error
