"""Credible intervals from samples: of a quantity between limits, and of a direction on the circle."""

import numpy as np

from emaphm.arrays import Array

BOUND_PREFERENCE = 0.02
"""An interval that begins at a bound may be longer by this share, the Monte Carlo error of a length."""

WHOLE = 0.9
"""An interval longer than this share of its range, or of a turn, is given as all of it."""


def shortest_interval(
    values: Array, power: int = 1, limits: tuple[float, float] = (0.0, 1.0)
) -> tuple[float, float]:
    """Return the shortest interval that holds 95 % of `values` (n,), which lie between `limits`.

    It is shortest in `values` to a power: in the eccentricity's square, in which its prior is even, so that
    0 is not left out merely because a disk has little area about its centre. One that begins or ends at
    a bound is taken where it is `BOUND_PREFERENCE`, and all of the range instead of more than `WHOLE`.
    """
    least, width = limits[0], limits[1] - limits[0]
    ordered = ((np.sort(values) - least) / width) ** power
    held = int(np.ceil(0.95 * ordered.size))
    lengths = ordered[held - 1 :] - ordered[: ordered.size - held + 1]
    first = int(np.argmin(lengths))
    if lengths[first] > WHOLE:
        return limits
    ends = (float(ordered[first]), float(ordered[first + held - 1]))
    most = (1 + BOUND_PREFERENCE) * float(lengths[first])
    for at_bound in ((0.0, float(ordered[held - 1])), (float(ordered[-held]), 1.0)):
        if at_bound[1] - at_bound[0] <= most:
            ends, most = at_bound, at_bound[1] - at_bound[0]
    return least + width * ends[0] ** (1 / power), least + width * ends[1] ** (1 / power)


def shortest_arc(turns: Array) -> tuple[tuple[float, float], float]:
    """Return the shortest arc that holds 95 % of `turns` (n,) in [0, 1], and the median counted along it.

    It may run past 1; where it is longer than `WHOLE`, it is (0, 1).
    """
    ordered = np.sort(turns)
    held = int(np.ceil(0.95 * ordered.size))
    around = np.concatenate([ordered, ordered + 1])
    lengths = around[held - 1 : held - 1 + ordered.size] - ordered
    first = int(np.argmin(lengths))
    # What is left out lies opposite the arc's middle: there the circle is cut open.
    cut = ordered[first] + lengths[first] / 2 - 0.5
    median = float((cut + np.median((turns - cut) % 1)) % 1)
    if lengths[first] > WHOLE:
        return (0.0, 1.0), median
    low, high = float(ordered[first]), float(ordered[first] + lengths[first])
    return (low, high), median + (1.0 if median < low else 0.0)
