"""The principal components of a training set: what a network reads, and how unlike it a recording is."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from emaphm.amortized.networks.layers import Dense
from emaphm.arrays import Array, Single

MOST_FITTED = 16_384
"""Draws that the components are computed from; more change none of those that matter."""


@dataclass(frozen=True, eq=False)
class Projection:
    """Principal components of rows (n, channels, blocks).

    `units` (channels,) are what rows are divided by, `mean` (channels × blocks,) is the training set's in
    these units, `basis` (channels × blocks, k) its principal directions, `deviations` (k,) its standard
    deviations along them.
    """

    units: Array
    mean: Single
    basis: Single
    deviations: Array

    @classmethod
    def of(cls, rows: Single, noise: Single, components: int) -> "Projection":
        """Return the `components` first directions of noise-free `rows` with `noise` (channels,) added.

        A channel's unit is its noise, and a hundredth of its scatter at least: what is exact is not known
        to be so.
        """
        taken = rows[:MOST_FITTED]
        units = np.maximum(noise, LEAST_NOISE * taken.std(axis=(0, 2)))
        flat = (taken / units[:, np.newaxis]).reshape(len(taken), -1)
        mean = flat.mean(axis=0)
        flat -= mean
        covariance = (flat.T @ flat).astype(float) / len(flat)
        covariance += np.diag(np.repeat((noise / units) ** 2, rows.shape[2]))
        variances, directions = np.linalg.eigh(covariance)
        first = np.argsort(variances)[::-1][: min(components, len(taken) // 2)]
        # The rows have single precision: below it, a direction is rounding.
        first = first[variances[first] > np.finfo(np.float32).eps * variances.max()]
        return cls(
            units.astype(float),
            mean.astype(np.float32),
            _half(directions[:, first]),
            np.sqrt(variances[first]),
        )

    def features(self, rows: Single) -> Single:
        """Return the standardised components of rows (n, channels, blocks), (n, k)."""
        return np.asarray(self.layer(self._flat(rows)) / self._deviations)

    @cached_property
    def layer(self) -> Dense:
        """What makes components, in units of the rows', of rows in the channels' units, end to end."""
        return Dense(self.basis, -(self.mean @ self.basis))

    @cached_property
    def _units(self) -> Single:
        return self.units.astype(np.float32)[:, np.newaxis]

    @cached_property
    def _deviations(self) -> Single:
        return self.deviations.astype(np.float32)

    def _flat(self, rows: Single) -> Single:
        """Return rows in the channels' units, end to end, (n, channels × blocks)."""
        return np.asarray((rows.reshape(len(rows), self.units.size, -1) / self._units).reshape(len(rows), -1))

    def distances(self, rows: Single, features: Single) -> Array:
        """Return two distances from the training set, (n, 2), each 1 or so for what belongs to it.

        The rms of the standardised components (Hotelling's T²), and the rms of what the components leave of
        the rows, in the channels' units (the Q statistic of process monitoring, Jackson and Mudholkar 1979).
        """
        flat = (rows / self.units[:, np.newaxis]).reshape(len(rows), -1) - self.mean
        within = np.sum((features * self.deviations) ** 2, axis=1)
        remaining = np.maximum(np.sum(flat.astype(float) ** 2, axis=1) - within, 0.0)
        squares = [np.mean(features.astype(float) ** 2, axis=1), remaining / flat.shape[1]]
        return np.asarray(np.sqrt(np.stack(squares, axis=1)))


LEAST_NOISE = 0.01
"""Least unit of a channel, relative to its scatter over the training set."""


def _half(values: Array) -> Single:
    """Return numbers as a file has them: of half precision."""
    return np.asarray(values.astype(np.float16).astype(np.float32))
