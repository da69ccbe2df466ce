"""The error of a diagnosis against the truth, in percent."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def error_percent(truth: ArrayLike, found: ArrayLike) -> NDArray[np.float64]:
    """Return the error [%] of fault vectors `found` (…, 8) against `truth` (…, 8).

    100 sqrt(sum_{i=1..6} (K_i - k_i)² + K_6 wrap(K_7 - k_7)² + (K_8 - k_8)²): the phase counts as much as
    there is eccentricity, its difference taken on the circle. Source: thesis 6.4, with what its formula
    omits.
    """
    K, k = np.asarray(truth, float), np.asarray(found, float)
    difference = K - k
    phase = difference[..., 6] - np.round(difference[..., 6])
    squares = np.sum(difference[..., :6] ** 2, axis=-1) + K[..., 5] * phase**2 + difference[..., 7] ** 2
    return np.asarray(100 * np.sqrt(squares))
