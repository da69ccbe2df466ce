"""Rests of a stuck shaft: where it stopped is chance, and so is the current that it stands with.

Switching decides by how much a shaft overshoots before dry friction holds it. The error of position that is
left makes a standing current, the same in every row of the rest. Hundreds of rows agree on it, and all are
off together: as observations of their own they would outvote the motion. What of a rest's mean is chance is
therefore estimated and left out. How large it is beforehand, and how it divides between the channels, the
reference model's runs say, which differ by the switching alone. Where they agree the mean is compared.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array


@dataclass(frozen=True, eq=False)
class Rests:
    """Stretches of rows in which the shaft stands, and what of their means is chance.

    Attributes
    ----------
    bounds
        First row of each of k rests, and the first after it, (k, 2), in the order of time.
    patterns
        The channels' deviations in each rest that go with one standard deviation of its chance, in their
        units, (k, channels).
    weights
        What the estimate of that chance takes of the mean residual of each channel, in one over its unit,
        (k, channels).
    """

    bounds: NDArray[np.intp]
    patterns: Array
    weights: Array

    @classmethod
    def of(cls, bounds: NDArray[np.intp], patterns: Array, noise: Array) -> "Rests":
        """Return rests of such `patterns`, where a row of a channel has white `noise` (channels,)."""
        precisions = np.diff(bounds, axis=1) * patterns / noise**2
        # The chance has variance 1 beforehand: where no run differs from another, nothing is taken for it.
        weights = precisions / (1.0 + np.sum(precisions * patterns, axis=1, keepdims=True))
        return cls(bounds, patterns, weights)

    def draw(self, shown: Array, measured: Array) -> None:
        """Draw the means of `shown` (n, channels, rows) to those `measured` (channels, rows), in place.

        By the estimate of each rest's chance, which a residual has nothing of then. All is in the
        channels' units.
        """
        lengths = np.diff(self.bounds, axis=1)[:, 0]
        rest = np.repeat(np.arange(lengths.size), lengths)
        rows = np.arange(rest.size) + np.repeat(self.bounds[:, 0] - np.cumsum(lengths) + lengths, lengths)
        residual = measured[:, rows] - shown[:, :, rows]
        means = np.add.reduceat(residual, np.cumsum(lengths) - lengths, axis=2) / lengths
        chance = np.einsum("nck,kc->nk", means, self.weights)
        shown[:, :, rows] += np.einsum("nk,kc->nck", chance, self.patterns)[:, :, rest]
