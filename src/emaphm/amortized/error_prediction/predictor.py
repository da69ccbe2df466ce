"""A small network that predicts the error of an answer, relative to the allowed error.

It is trained on simulations with and without deviations (`emaphm.amortized.error_prediction.deviations`); the
errors of their answers are known.
"""

from dataclasses import dataclass

import numpy as np

from emaphm.amortized.networks.network import Network
from emaphm.arrays import Array, Single
from emaphm.diagnosis.error_metric import WRONG_ERROR, WRONG_HALF_WIDTHS
from emaphm.diagnosis.verdict import Z95


@dataclass(frozen=True)
class WrongSettings:
    """Definition of a wrong answer.

    The error of a fault is larger than `error`, in its unit [0, 1], and larger than `half_widths` half-widths
    of its 95 % interval. Error ratios below `least` are learned as `least`.
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
        """Return the predicted error ratio of each of the answers with `features` (n, k), (n,)."""
        mixtures = self.network.mixtures(self.network.features(features))
        return np.asarray(np.exp([float(mixture.mean[0]) for mixture in mixtures]))


def error_ratios(means: Array, variances: Array, truths: Array, faults: int) -> Array:
    """Return the largest error of a fault, relative to the error that `WRONG` allows, for n answers, (n,).

    `means`, `variances` and `truths` are (n, d); their first `faults` coordinates are the faults.
    """
    errors = np.abs(means - truths)[:, :faults]
    allowed = WRONG.half_widths * Z95 * np.sqrt(variances[:, :faults])
    return np.asarray(np.maximum(errors / np.maximum(WRONG.error, allowed), WRONG.least).max(axis=1))
