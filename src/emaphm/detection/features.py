"""Features of a cycle: each channel's residual in each segment, in a few numbers."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.detection.segments import StrokeSegment
from emaphm.detection.settings import DetectorSettings

NO_SCATTER = 1e-6
"""Scatter, relative to a channel's own, that counts as none: a constant has no logarithm of its scatter."""


@dataclass(frozen=True)
class Feature:
    """One number of a cycle: of which channel and segment (its place in the list), and what."""

    channel: str
    segment: int
    kind: str


SHAPES = ("scatter", "roughness", "coarse roughness")
"""Logarithms of the rms about the mean, of the difference of successive rows, and of the difference of
successive means of two rows: they tell a trend, a ripple and noise apart."""


def feature_names(
    channels: Sequence[str], segments: Sequence[StrokeSegment], settings: DetectorSettings
) -> tuple[Feature, ...]:
    """Return the features in the order of `features_of`."""
    names = []
    for place, segment in enumerate(segments):
        names += [Feature(channel, place, "mean") for channel in channels]
        if _has_shape(segment, settings):
            names += [Feature(channel, place, shape) for shape in SHAPES for channel in channels]
    return tuple(names)


def features_of(
    residuals: Array, segments: Sequence[StrokeSegment], scales: Array, settings: DetectorSettings
) -> Array:
    """Return the features of cycles.

    Parameters
    ----------
    residuals
        Residual of each channel, (cycles, rows, channels), in its unit.
    scales
        Size of each channel's residual in health, (channels,), in its unit.

    Returns
    -------
    (cycles, features), without a unit: means are relative to `scales`.
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
            values += [np.log(np.maximum(one.std(axis=1), NO_SCATTER)) for one in shapes]
    return np.concatenate(values, axis=1)


def _has_shape(segment: StrokeSegment, settings: DetectorSettings) -> bool:
    return segment.stop - segment.first >= settings.fewest_rows_of_shape
