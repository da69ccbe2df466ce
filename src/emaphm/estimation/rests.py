"""Rests of a stuck shaft: the position at which it stops is random, and so is the current during the rest.

Switching determines by how much a shaft overshoots before dry friction holds it. The remaining position error
causes a constant current, equal in all rows of the rest. Hundreds of rows then have the same error: counted
as independent observations they would outweigh the motion. The random part of a rest's mean is therefore
estimated and removed from the residual. Its prior variance and its distribution over the channels come from
runs of the reference model that differ only in the switching. If these runs agree, the mean is compared.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array


@dataclass(frozen=True, eq=False)
class Rests:
    """Intervals of rows in which the shaft stands, and the random part of their means.

    Attributes
    ----------
    bounds
        First row of each of k rests, and the first row after it, (k, 2), in order of time.
    patterns
        Deviations of the channels in each rest for one standard deviation of its random variable, in their
        units, (k, channels).
    weights
        Weights of the channels' mean residuals in the estimate of that random variable, each in 1 / unit of
        the channel, (k, channels). The residual of a row that is not compared is 0.
    """

    bounds: NDArray[np.intp]
    patterns: Array
    weights: Array

    @classmethod
    def of(
        cls, bounds: NDArray[np.intp], patterns: Array, noise: Array, compared: NDArray[np.intp] | None = None
    ) -> "Rests":
        """Return rests with these `bounds` and `patterns`; each row has white `noise` (channels,), rms.

        `compared` are the numbers of compared rows, (k, channels); all rows if None.
        """
        lengths = np.diff(bounds, axis=1)
        precisions = (lengths if compared is None else compared) * patterns / noise**2
        # The random variable has the prior variance 1; if the runs do not differ, its weights are 0.
        variance = 1.0 / (1.0 + np.sum(precisions * patterns, axis=1, keepdims=True))
        weights = lengths * patterns / noise**2 * variance
        return cls(bounds, patterns, weights)

    def draw(self, shown: Array, measured: Array) -> None:
        """Shift `shown` (n, channels, rows) in each rest towards `measured` (channels, rows), in place.

        The shift is the estimated random part of the rest's mean, which the residual then no longer contains.
        All values are in the channels' units.
        """
        lengths = np.diff(self.bounds, axis=1)[:, 0]
        rest = np.repeat(np.arange(lengths.size), lengths)
        rows = np.arange(rest.size) + np.repeat(self.bounds[:, 0] - np.cumsum(lengths) + lengths, lengths)
        residual = measured[:, rows] - shown[:, :, rows]
        means = np.add.reduceat(residual, np.cumsum(lengths) - lengths, axis=2) / lengths
        estimates = np.einsum("nck,kc->nk", means, self.weights)
        shown[:, :, rows] += np.einsum("nk,kc->nck", estimates, self.patterns)[:, :, rest]
