"""The error of an answer, relative to the error that is allowed, as a small network predicts it.

It has learned from simulations, as they are and with what no simulation has
(`emaphm.amortized.error_prediction.deviations`), whose answers' errors are known.
"""

from dataclasses import dataclass

import numpy as np

from emaphm.amortized.networks.network import Network
from emaphm.arrays import Array, Single
from emaphm.diagnosis.error_metric import WRONG_ERROR, WRONG_HALF_WIDTHS
from emaphm.diagnosis.verdict import Z95


@dataclass(frozen=True)
class WrongSettings:
    """From when on an answer is wrong.

    A fault is off by more than `error`, in its unit [0, 1], and by more than `half_widths` of its 95 %
    interval. Ratios are learned from `least` on.
    """

    error: float = WRONG_ERROR
    half_widths: float = WRONG_HALF_WIDTHS
    least: float = 0.1


WRONG = WrongSettings()


@dataclass(frozen=True, eq=False)
class ErrorPredictor:
    """The network, whose one coordinate is the logarithm of `error_ratios`."""

    network: Network

    def predicted(self, features: Single) -> Array:
        """Return the predicted ratio of each of the answers with these features (n, k), (n,)."""
        found = self.network.mixtures(self.network.features(features))
        return np.asarray(np.exp([float(one.mean[0]) for one in found]))


def error_ratios(means: Array, variances: Array, truths: Array, faults: int) -> Array:
    """Return how many times as large as allowed the largest error of a fault is, (n,).

    Of answers with `means` and `variances` (n, d), whose first coordinates are the `faults`; 1 is what
    `WRONG` allows.
    """
    errors = np.abs(means - truths)[:, :faults]
    allowed = WRONG.half_widths * Z95 * np.sqrt(variances[:, :faults])
    return np.asarray(np.maximum(errors / np.maximum(WRONG.error, allowed), WRONG.least).max(axis=1))
