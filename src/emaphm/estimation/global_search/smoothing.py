"""Low-pass filter on the channels, which removes local minima of the objective."""

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.objective import MapObjective

SMOOTHING_S = 4e-3
"""Standard deviation of the Gaussian low-pass on the channels [s].

It removes the details of commutation, ripple and stick-slip that cause local minima with heavy shorts. Half
and twice this value work nearly as well; without a filter, or with 16 ms, most searches of the multiple-fault
case fail.
"""

BLOCKS = 4
"""Number of means per standard deviation of the low-pass."""

TRUNCATION = 4.0
"""Length of either tail of the low-pass, in standard deviations."""


def low_pass(objective: MapObjective, outputs: Array) -> Array:
    """Return low-pass filtered channels of `outputs` (…, rows), and the rows after the channels unchanged.

    A smooth signal needs few rows: means over `1 / BLOCKS` of a standard deviation replace the rows, scaled
    so that sums of squares keep their size.
    """
    inputs = objective.problem.inputs
    samples, rows = inputs.samples, objective.channel_rows
    deviation = SMOOTHING_S / inputs.interval
    block = int(np.clip(deviation / BLOCKS, 1, samples))
    smooth = block**0.5 * gaussian_filter(channel_means(objective, outputs, block), deviation / block)
    return np.concatenate([smooth.reshape(*outputs.shape[:-1], -1), outputs[..., rows:]], axis=-1)


def channel_means(objective: MapObjective, outputs: Array, count: int) -> Array:
    """Return the means of `count` rows each of the channels in `outputs` (…, rows), (…, channels, means)."""
    samples = objective.problem.samples
    channels = outputs[..., : objective.channel_rows].reshape(*outputs.shape[:-1], -1, samples)
    return np.asarray(
        channels[..., : samples // count * count].reshape(*channels.shape[:-1], -1, count).mean(axis=-1)
    )


def gaussian_filter(values: Array, deviation: float) -> Array:
    """Return `values` (…, n) filtered by a Gaussian with a standard `deviation` [samples].

    Beyond the ends, the first and the last value are continued.
    """
    reach = int(TRUNCATION * deviation + 0.5)
    offsets = np.arange(-reach, reach + 1)
    weights = np.exp(-0.5 * (offsets / deviation) ** 2)
    weights /= weights.sum()
    padded = np.pad(values, [(0, 0)] * (values.ndim - 1) + [(reach, reach)], mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, offsets.size, axis=-1)
    return np.asarray(windows @ weights)
