"""A low-pass on the channels that removes false minima of the objective."""

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.objective import MapObjective

SMOOTHING_S = 4e-3
"""Standard deviation of the Gaussian low-pass on the channels [s].

It removes the detail of commutation, ripple and stick-slip that makes false minima under heavy shorts: half
and twice as much serve nearly as well, none at all or 16 ms lose most runs of the multiple-fault case.
"""

BLOCKS = 4
"""Rows kept in a standard deviation of the low-pass."""

TRUNCATION = 4.0
"""Length of either tail of the low-pass, in standard deviations."""


def low_pass(objective: MapObjective, outputs: Array) -> Array:
    """Return the channels in `outputs` (…, rows) through the low-pass, and the rows after them unchanged.

    A smooth signal needs few rows: means over `1 / BLOCKS` of a standard deviation each stand for theirs,
    scaled so that sums of squares keep their size.
    """
    inputs = objective.problem.inputs
    samples, rows = inputs.samples, objective.channel_rows
    deviation = SMOOTHING_S / inputs.interval
    block = int(np.clip(deviation / BLOCKS, 1, samples))
    smooth = block**0.5 * gaussian_filter(channel_means(objective, outputs, block), deviation / block)
    return np.concatenate([smooth.reshape(*outputs.shape[:-1], -1), outputs[..., rows:]], axis=-1)


def channel_means(objective: MapObjective, outputs: Array, count: int) -> Array:
    """Return the channels in `outputs` (…, rows) in means of `count` rows each, (…, channels, means)."""
    samples = objective.problem.samples
    channels = outputs[..., : objective.channel_rows].reshape(*outputs.shape[:-1], -1, samples)
    return np.asarray(
        channels[..., : samples // count * count].reshape(*channels.shape[:-1], -1, count).mean(axis=-1)
    )


def gaussian_filter(values: Array, deviation: float) -> Array:
    """Return `values` (…, n) through a Gaussian of that `deviation` [samples], the ends held beyond them."""
    reach = int(TRUNCATION * deviation + 0.5)
    offsets = np.arange(-reach, reach + 1)
    weights = np.exp(-0.5 * (offsets / deviation) ** 2)
    weights /= weights.sum()
    held = np.pad(values, [(0, 0)] * (values.ndim - 1) + [(reach, reach)], mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(held, offsets.size, axis=-1)
    return np.asarray(windows @ weights)
