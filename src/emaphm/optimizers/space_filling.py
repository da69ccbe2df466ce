"""Start points that cover a box more evenly than independent random ones."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emaphm.errors import MethodError
from emaphm.optimizers.base import checked_box, from_unit, generator


def space_filling(n: int, lower: ArrayLike, upper: ArrayLike, seed: int) -> NDArray[np.float64]:
    """Return the first `n` points of a scrambled Sobol sequence in a box, shape (n, d).

    Parameters
    ----------
    n
        Number of points; even coverage is best for a power of two.
    lower, upper
        Bounds, shape (d,) each.
    seed
        Seed of the scrambling (Owen, 1998).

    Raises
    ------
    MethodError
        `n` is below 1, the seed is negative, or a lower bound is not less than its upper bound.
    """
    from scipy.stats import qmc

    if n < 1:
        raise MethodError(f"number of points must be at least 1, got {n}")
    low, high = checked_box(lower, upper)
    # Whole powers of two are drawn, then cut: scipy warns of any other number.
    unit = qmc.Sobol(low.size, seed=generator(seed, 0)).random_base2(int(n - 1).bit_length())[:n]
    return from_unit(unit, low, high)
