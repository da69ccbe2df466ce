"""Error of a diagnosis against the truth: in percent, and the limit above which a component is wrong."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emaphm.actuator import NAMES, Faults
from emaphm.arrays import floats
from emaphm.errors import FaultError

WRONG_ERROR = 0.03
"""Error of a component, in its unit [0, 1], above which it counts as wrong."""

WRONG_HALF_WIDTHS = 2.0
"""Number of half-widths of the 95 % interval that the error of a wrong component must also exceed."""


def error_percent(truth: ArrayLike | Faults, found: ArrayLike | Faults) -> NDArray[np.float64]:
    """Return the error [%] of fault vectors `found` (…, 8) against `truth` (…, 8); both may be `Faults`.

    100 sqrt(sum_{i=1..6} (K_i - k_i)² + K_6 wrap(K_7 - k_7)² + (K_8 - k_8)²), with K the truth and k the
    estimate: the error of the phase is taken on the circle and weighted by the eccentricity. Source: thesis
    6.4, completed with the terms that its formula omits.

    Raises
    ------
    FaultError
        A fault vector is not numeric, or does not have 8 components.
    """
    K, k = _vectors(truth), _vectors(found)
    difference = K - k
    phase = difference[..., 6] - np.round(difference[..., 6])
    squares = np.sum(difference[..., :6] ** 2, axis=-1) + K[..., 5] * phase**2 + difference[..., 7] ** 2
    return np.asarray(100 * np.sqrt(squares))


def _vectors(given: ArrayLike | Faults) -> NDArray[np.float64]:
    try:
        vectors = floats(given.vector if isinstance(given, Faults) else given)
    except TypeError as error:
        raise FaultError(f"a fault vector is {error}") from None
    if vectors.ndim == 0 or vectors.shape[-1] != len(NAMES):
        raise FaultError(f"a fault vector has {len(NAMES)} components, got shape {vectors.shape}")
    return vectors
