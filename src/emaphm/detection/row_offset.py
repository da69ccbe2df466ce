"""Offset in rows between two recordings of one command, to compare their responses at equal times."""

import numpy as np

from emaphm.arrays import Array

OFFSET_DEVIATIONS = 5.0
"""Standard deviations by which an offset of two commands must fit better than no offset."""

ROUNDING = 1e-9
"""Difference of two commands, relative to their size, that counts as none: unit conversion causes it."""


def row_offset(command: Array, other: Array, most: int) -> int:
    """Return the number of rows of `other` (m,) before the first row of `command` (n,), within ±`most`.

    It is the offset with the least mean squared difference d². Between equal commands with white noise, d² at
    two offsets differs by chance with the standard deviation d² √(2/n). If d² at 0 is not larger than the
    least by `OFFSET_DEVIATIONS` of this, 0 is returned.
    """
    n = min(command.size, other.size)
    most = min(most, n - 1)
    mean = float(other.mean())
    x, y = command - mean, other - mean
    at_zero = _mean_square(x, y, 0)
    if at_zero <= (ROUNDING * float(np.abs(y).max())) ** 2:
        return 0
    offsets = np.arange(-most, most + 1)
    length = 1 << (x.size + y.size).bit_length()  # a power of 2, for which the transform is fast
    products = np.fft.irfft(np.fft.rfft(y, length) * np.conj(np.fft.rfft(x, length)), length)
    # The overlap at an offset k is rows a to b of `command`, and a + k to b + k of `other`.
    first, stop = np.maximum(0, -offsets), np.minimum(x.size, y.size - offsets)
    squares_x, squares_y = (np.concatenate([[0.0], np.cumsum(values**2)]) for values in (x, y))
    sums = squares_x[stop] - squares_x[first]
    sums += squares_y[stop + offsets] - squares_y[first + offsets]
    best = int(offsets[np.argmin((sums - 2 * products[offsets]) / (stop - first))])
    least = _mean_square(x, y, best)
    return best if at_zero > least * (1 + OFFSET_DEVIATIONS * np.sqrt(2 / n)) else 0


def _mean_square(x: Array, y: Array, offset: int) -> float:
    """Return the mean squared difference of rows k of `x` and k + `offset` of `y`, where both exist."""
    first, stop = max(0, -offset), min(x.size, y.size - offset)
    return float(np.mean((x[first:stop] - y[first + offset : stop + offset]) ** 2))
