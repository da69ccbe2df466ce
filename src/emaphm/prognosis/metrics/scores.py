"""Calibration and scores of predictions of many units: PIT, coverage, CRPS and Brier score.

References
----------
[1] Gneiting, Raftery: Strictly proper scoring rules, prediction, and estimation, Journal of the American
    Statistical Association 102 (2007).
[2] Brier: Verification of forecasts expressed in terms of probability, Monthly Weather Review 78 (1950).
[3] Dawid: Present position and potential developments: the prequential approach, Journal of the Royal
    Statistical Society A 147 (1984).
"""

import numpy as np
from numpy.typing import ArrayLike

from emaphm.errors import PrognosisError
from emaphm.prognosis.metrics.prediction import Prediction


def probability_integral_transform(prediction: Prediction, true: float) -> float:
    """Return P(RUL < true) + P(RUL = true) / 2 [3]; uniform on [0, 1] over many calibrated predictions."""
    below = np.searchsorted(prediction.sample, true, "left")
    upto = np.searchsorted(prediction.sample, true, "right")
    return float(below + upto) / (2 * prediction.sample.size)


def coverage(transforms: ArrayLike, share: float = 0.9) -> float:
    """Return the share of the probability integral transforms (n,) in the central interval of `share`."""
    values = np.asarray(transforms, float)
    return float(np.mean(np.abs(values - 0.5) <= share / 2))


def crps(sample: ArrayLike, true: float, *, longest: float = np.inf) -> float:
    """Return the continuous ranked probability score [h] of a sample (n,) against the `true` RUL.

    CRPS = ∫ (F(x) - 1[x ≥ true])² dx = E|X - true| - ½ E|X - X'|            [1, eq. 20, 21]

    Values above `longest` [h], including the true RUL, are set to `longest`: a sample that contains `inf` (no
    failure in sight) has a finite score only up to a finite time.
    """
    x = np.minimum(np.sort(np.asarray(sample, float)), longest)
    n = x.size
    if not np.isfinite(x[-1]):
        return float(np.inf)
    # E|X - X'| of a sorted sample: 2 Σ (2 i - n - 1) x_i / n², i from 1.
    spread = 2 * np.sum((2 * np.arange(1, n + 1) - n - 1) * x) / n**2
    return float(np.mean(np.abs(x - min(true, longest))) - spread / 2)


def brier(probabilities: ArrayLike, happened: ArrayLike) -> float:
    """Return the Brier score of "fails within H": the mean of (probability - 1 or 0)² [2]."""
    p, o = np.asarray(probabilities, float), np.asarray(happened, bool)
    if p.shape != o.shape or not p.size or not np.all((p >= 0) & (p <= 1)):
        raise PrognosisError("the Brier score takes as many probabilities in [0, 1] as outcomes, one or more")
    return float(np.mean((p - o) ** 2))
