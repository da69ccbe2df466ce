"""By how many rows two recordings of one command begin apart: what responds to it is compared in step."""

import numpy as np

from emaphm.arrays import Array

OFFSET_DEVIATIONS = 5.0
"""By how many standard deviations another offset of two commands must fit better than none."""

ROUNDING = 1e-9
"""Difference of two commands, relative to their size, that counts as none: units converted make it."""


def row_offset(command: Array, other: Array, most: int) -> int:
    """Return how many rows of `other` (m,) lie before the first of `command` (n,), `most` in size at most.

    Of all offsets, that of the least mean squared difference, d². Between commands with white noise alone,
    d² at two offsets differs by chance with the standard deviation d² √(2/n); 0 is returned where d² at 0 is
    not larger by `OFFSET_DEVIATIONS` of that.
    """
    n = min(command.size, other.size)
    most = min(most, n - 1)
    mean = float(other.mean())
    one, two = command - mean, other - mean
    at_zero = _mean_square(one, two, 0)
    if at_zero <= (ROUNDING * float(np.abs(two).max())) ** 2:
        return 0
    offsets = np.arange(-most, most + 1)
    length = 1 << (one.size + two.size).bit_length()  # a power of 2, of which the transform is fast
    products = np.fft.irfft(np.fft.rfft(two, length) * np.conj(np.fft.rfft(one, length)), length)
    # The overlap at an offset k is rows a to b of `command`, and a + k to b + k of `other`.
    first, stop = np.maximum(0, -offsets), np.minimum(one.size, two.size - offsets)
    squares_one, squares_two = (np.concatenate([[0.0], np.cumsum(x**2)]) for x in (one, two))
    sums = squares_one[stop] - squares_one[first]
    sums += squares_two[stop + offsets] - squares_two[first + offsets]
    best = int(offsets[np.argmin((sums - 2 * products[offsets]) / (stop - first))])
    least = _mean_square(one, two, best)
    return best if at_zero > least * (1 + OFFSET_DEVIATIONS * np.sqrt(2 / n)) else 0


def _mean_square(first_rows: Array, second_rows: Array, offset: int) -> float:
    """Return the mean squared difference of two where they overlap, in rows k and k + `offset`."""
    first, stop = max(0, -offset), min(first_rows.size, second_rows.size - offset)
    return float(np.mean((first_rows[first:stop] - second_rows[first + offset : stop + offset]) ** 2))
