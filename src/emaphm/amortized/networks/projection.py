"""Principal components of a training set: a network's input, and the distances of recordings from the set."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from emaphm.amortized.networks.layers import Dense
from emaphm.arrays import Array, Single

MOST_FITTED = 16_384
"""Largest number of draws from which the components are computed; more do not change the relevant ones."""


@dataclass(frozen=True, eq=False)
class Projection:
    """Principal components of rows (n, channels, blocks).

    Rows are divided by `units` (channels,). In these units, `mean` (channels × blocks,) is the mean of the
    training set, `basis` (channels × blocks, k) are its principal directions, and `deviations` (k,) are its
    standard deviations along them.
    """

    units: Array
    mean: Single
    basis: Single
    deviations: Array

    @classmethod
    def of(cls, rows: Single, noise: Single, components: int) -> "Projection":
        """Return the first `components` principal directions of noise-free `rows` plus `noise` (channels,).

        The unit of a channel is its rms noise, but at least `LEAST_NOISE` of its scatter, because a channel
        without described noise need not be exact.
        """
        fitted = rows[:MOST_FITTED]
        units = np.maximum(noise, LEAST_NOISE * fitted.std(axis=(0, 2)))
        flat = (fitted / units[:, np.newaxis]).reshape(len(fitted), -1)
        mean = flat.mean(axis=0)
        flat -= mean
        covariance = (flat.T @ flat).astype(float) / len(flat)
        covariance += np.diag(np.repeat((noise / units) ** 2, rows.shape[2]))
        variances, directions = np.linalg.eigh(covariance)
        first = np.argsort(variances)[::-1][: min(components, len(fitted) // 2)]
        # The rows have single precision: directions with a smaller variance are rounding errors.
        first = first[variances[first] > np.finfo(np.float32).eps * variances.max()]
        return cls(
            units.astype(float),
            mean.astype(np.float32),
            _half(directions[:, first]),
            np.sqrt(variances[first]),
        )

    def features(self, rows: Single) -> Single:
        """Return the standardised components of rows (n, channels, blocks), (n, k)."""
        return np.asarray(self.layer(in_units(rows, self.units)) / self._deviations)

    @cached_property
    def layer(self) -> Dense:
        """The layer from rows in the channels' units, concatenated, to the components in these units."""
        return Dense(self.basis, -(self.mean @ self.basis))

    @cached_property
    def _deviations(self) -> Single:
        return self.deviations.astype(np.float32)

    def distances(self, rows: Single, features: Single) -> Array:
        """Return two distances from the training set, (n, 2), each about 1 for recordings like its draws.

        The rms of the standardised components (Hotelling's T²), and the rms residual of the rows from the
        components, in the channels' units (the Q statistic of process monitoring, Jackson and Mudholkar
        1979).
        """
        flat = (rows / self.units[:, np.newaxis]).reshape(len(rows), -1) - self.mean
        within = np.sum((features * self.deviations) ** 2, axis=1)
        remaining = np.maximum(np.sum(flat.astype(float) ** 2, axis=1) - within, 0.0)
        squares = [np.mean(features.astype(float) ** 2, axis=1), remaining / flat.shape[1]]
        return np.asarray(np.sqrt(np.stack(squares, axis=1)))


LEAST_NOISE = 0.01
"""Least unit of a channel, relative to its scatter over the training set."""


def in_units(rows: Single, units: Array) -> Single:
    """Return the rows of n recordings in the channels' `units` (channels,), concatenated, (n, rows)."""
    by_channel = rows.reshape(len(rows), units.size, -1)
    return np.asarray((by_channel / units.astype(np.float32)[:, np.newaxis]).reshape(len(rows), -1))


def _half(values: Array) -> Single:
    """Return values rounded to half precision, as in a file."""
    return np.asarray(values.astype(np.float16).astype(np.float32))
