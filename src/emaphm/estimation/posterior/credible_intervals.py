"""Credible intervals from samples, for a quantity between limits and for a direction on the circle."""

import numpy as np

from emaphm.arrays import Array

BOUND_PREFERENCE = 0.02
"""Relative excess length that is accepted for an interval at a bound: the Monte Carlo error of a length."""

WHOLE = 0.9
"""Length of an interval, relative to its range or to a turn, above which the full range is returned."""


def shortest_interval(
    values: Array, power: int = 1, limits: tuple[float, float] = (0.0, 1.0)
) -> tuple[float, float]:
    """Return the shortest interval that contains 95 % of `values` (n,), which lie between `limits`.

    It is the shortest interval of `values` to the given power: 2 for the eccentricity, the square of which
    has a uniform prior, so that 0 is not excluded merely because a disk has little area near its centre. An
    interval that begins or ends at a bound is preferred if it is longer by at most `BOUND_PREFERENCE`. Above
    the length `WHOLE`, the full range is returned.
    """
    least, width = limits[0], limits[1] - limits[0]
    ordered = ((np.sort(values) - least) / width) ** power
    count = int(np.ceil(0.95 * ordered.size))
    lengths = ordered[count - 1 :] - ordered[: ordered.size - count + 1]
    first = int(np.argmin(lengths))
    if lengths[first] > WHOLE:
        return limits
    ends = (float(ordered[first]), float(ordered[first + count - 1]))
    most = (1 + BOUND_PREFERENCE) * float(lengths[first])
    for at_bound in ((0.0, float(ordered[count - 1])), (float(ordered[-count]), 1.0)):
        if at_bound[1] - at_bound[0] <= most:
            ends, most = at_bound, at_bound[1] - at_bound[0]
    return least + width * ends[0] ** (1 / power), least + width * ends[1] ** (1 / power)


def shortest_arc(turns: Array) -> tuple[tuple[float, float], float]:
    """Return the shortest arc that contains 95 % of `turns` (n,) in [0, 1], and the median along it.

    The arc may extend beyond 1; above the length `WHOLE`, it is (0, 1).
    """
    ordered = np.sort(turns)
    count = int(np.ceil(0.95 * ordered.size))
    two_turns = np.concatenate([ordered, ordered + 1])
    lengths = two_turns[count - 1 : count - 1 + ordered.size] - ordered
    first = int(np.argmin(lengths))
    # The circle is cut opposite the arc's middle, where the excluded values are.
    cut = ordered[first] + lengths[first] / 2 - 0.5
    median = float((cut + np.median((turns - cut) % 1)) % 1)
    if lengths[first] > WHOLE:
        return (0.0, 1.0), median
    low, high = float(ordered[first]), float(ordered[first] + lengths[first])
    return (low, high), median + (1.0 if median < low else 0.0)
