"""Compiled product with a matrix in half precision, for a few recordings.

For one recording, a product takes the time of reading the matrix. In half precision, the matrix has half the
bytes of single precision. It is converted row by row, in the processor's first cache.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from emaphm.arrays import Single

Bits = NDArray[np.uint16]
"""Half-precision numbers (IEEE 754 binary16) as bits: 1 for the sign, 5 the exponent, 10 the fraction."""

MAGNITUDE = np.uint32(0x7FFF)
"""Mask of all bits except the sign."""

LONGER = np.uint32(13)
"""Difference of the fraction's bits in single and half precision."""

EXPONENTS_APART, EXPONENT = np.uint32((127 - 15) << 23), np.uint32(1 << 23)
"""Difference of the exponents' biases in single and half precision, and an exponent of 1, as bits."""

LEAST_NORMAL, LEAST_NORMAL_VALUE = np.uint32(1 << 10), np.float32(2.0**-14)
"""The smallest normal number in half precision, as bits and as value; smaller numbers are subnormal."""


@njit(cache=True, fastmath=True, nogil=True)
def add_product(left: Single, right: Bits, total: Any) -> None:
    """Add `left` (n, k) times `right` (k, m) to `total` (n, m); `right` is finite, in half precision."""
    row = np.empty(right.shape[1], np.float32)
    for i in range(right.shape[0]):
        for j in range(row.size):
            half = np.uint32(right[i, j])
            magnitude = np.uint32(half & MAGNITUDE)
            bits = np.uint32((magnitude << LONGER) + EXPONENTS_APART)
            if magnitude >= LEAST_NORMAL:
                value = bits.view(np.float32)
            else:
                value = np.uint32(bits + EXPONENT).view(np.float32) - LEAST_NORMAL_VALUE
            row[j] = value if half == magnitude else -value
        for n in range(left.shape[0]):
            for j in range(row.size):
                total[n, j] += left[n, i] * row[j]
