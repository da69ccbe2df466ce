"""An exponential without a call, for kernels."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.inline import law

LARGEST = 40.0
"""Exponent beyond which the function is 0 for all purposes: exp(-40) = 4e-18."""


@law
def decaying_exponential(exponent: Any) -> Any:
    """Return exp(-y) for y ≥ 0, by products and one division.

        exp(-y) ≈ (1 + z + z²/2 + z³/6)⁻⁸,   z = y / 8

    Parameters
    ----------
    exponent : y ≥ 0 [-]

    Returns
    -------
    exp(-y), in (0, 1] [-]; exact at 0, within 4e-4 everywhere.
    """
    z = np.minimum(exponent, LARGEST) * 0.125
    series = 1.0 + z * (1.0 + z * (0.5 + z * (1 / 6)))
    square = series * series
    fourth = square * square
    return 1.0 / (fourth * fourth)
