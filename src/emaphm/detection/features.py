"""Features of a cycle: mean and shape of each channel's residual in each segment."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.detection.segments import StrokeSegment
from emaphm.detection.settings import DetectorSettings

LEAST_SCATTER = 1e-6
"""Least scatter, relative to the channel's healthy residual: a constant has no logarithm of its scatter."""


@dataclass(frozen=True)
class Feature:
    """Identity of a feature: channel, segment (index in the list), and kind ("mean" or one of `SHAPES`)."""

    channel: str
    segment: int
    kind: str


SHAPES = ("scatter", "roughness", "coarse roughness")
"""Logarithms of the standard deviation, of that of the differences of successive rows, and of that of the
differences of successive means of two rows. Together they separate a trend, a ripple and noise."""


def feature_names(
    channels: Sequence[str], segments: Sequence[StrokeSegment], settings: DetectorSettings
) -> tuple[Feature, ...]:
    """Return the features in the order of `features_of`."""
    names = []
    for k, segment in enumerate(segments):
        names += [Feature(channel, k, "mean") for channel in channels]
        if _has_shape(segment, settings):
            names += [Feature(channel, k, shape) for shape in SHAPES for channel in channels]
    return tuple(names)


def features_of(
    residuals: Array, segments: Sequence[StrokeSegment], scales: Array, settings: DetectorSettings
) -> Array:
    """Return the features of cycles, (cycles, features).

    Parameters
    ----------
    residuals
        Residual of each channel, (cycles, rows, channels), in its unit.
    scales
        Healthy rms residual of each channel, (channels,), in its unit.

    Returns
    -------
    Features without a unit, (cycles, features): residuals are divided by `scales`.
    """
    relative = residuals / scales
    values = []
    for segment in segments:
        part = relative[:, segment.rows]
        values.append(part.mean(axis=1))
        if _has_shape(segment, settings):
            pairs = part[:, : part.shape[1] // 2 * 2]
            coarse = pairs.reshape(len(part), -1, 2, part.shape[2]).mean(axis=2)
            shapes = (part, np.diff(part, axis=1), np.diff(coarse, axis=1))
            values += [np.log(np.maximum(shape.std(axis=1), LEAST_SCATTER)) for shape in shapes]
    return np.concatenate(values, axis=1)


def _has_shape(segment: StrokeSegment, settings: DetectorSettings) -> bool:
    return segment.stop - segment.first >= settings.fewest_rows_of_shape
