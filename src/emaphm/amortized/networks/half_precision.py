"""Products with matrices of half precision, for a few recordings at once: the compiled inner loop.

Of one recording, the time of a product is that of reading the matrix. Numbers of half precision are half as
many bytes as those of single precision, and become these one row at a time, in the nearest cache.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from emaphm.arrays import Single

Bits = NDArray[np.uint16]
"""Numbers of half precision (IEEE 754 binary16) as bits: the sign, 5 of the exponent, 10 of the fraction."""

MAGNITUDE = np.uint32(0x7FFF)
"""All bits but the sign."""

LONGER = np.uint32(13)
"""Bits that the fraction of single precision has more."""

EXPONENTS_APART, EXPONENT = np.uint32((127 - 15) << 23), np.uint32(1 << 23)
"""What exponents of single precision have more, and 1 of it, as bits."""

LEAST_NORMAL, LEAST_NORMAL_VALUE = np.uint32(1 << 10), np.float32(2.0**-14)
"""The least number with an exponent: below, the fraction alone counts, in the steps of that exponent."""


@njit(cache=True, fastmath=True, nogil=True)
def add_product(left: Single, right: Bits, total: Any) -> None:
    """Add `left` (n, k) times `right` (k, m), which is finite, to `total` (n, m) of single precision."""
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
