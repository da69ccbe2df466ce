"""Randomly shifted lattice: points that cover a box more evenly than independent random points."""

import numpy as np
from numpy.typing import ArrayLike

from emaphm.arrays import Array
from emaphm.errors import MethodError
from emaphm.optimizers.box import checked_box, from_unit
from emaphm.random_streams import stream

MOST_CANDIDATES = 256
"""Largest number of candidates for a component of a generating vector; limits time and memory for large n."""


def space_filling(n: int, lower: ArrayLike, upper: ArrayLike, seed: int) -> Array:
    """Return `n` points of a randomly shifted rank-1 lattice in a box, shape (n, d).

    In the unit cube, point k is the fractional part of k z / n + s, with a vector z of whole numbers for n
    and d [1], [2], and a shift s drawn uniformly from the cube [3]. Each component has n values at equal
    distances. The discrepancy is that of a scrambled Sobol sequence, but for any n, not only for powers of
    two; `tests/optimizers/test_space_filling.py` compares them.

    Parameters
    ----------
    n
        Number of points.
    lower, upper
        Bounds, shape (d,) each.
    seed
        Seed of the shift.

    Raises
    ------
    MethodError
        `n` is below 1, or a lower bound is not less than its upper bound.
    SignalError
        The seed is negative.

    References
    ----------
    .. [1] J. Dick, F. Y. Kuo and I. H. Sloan, "High-dimensional integration: the quasi-Monte Carlo way",
       Acta Numerica 22, 2013.
    .. [2] I. H. Sloan and A. V. Reztsov, "Component-by-component construction of good lattice rules",
       Mathematics of Computation 71, 2002.
    .. [3] R. Cranley and T. N. L. Patterson, "Randomization of number theoretic methods for multiple
       integration", SIAM Journal on Numerical Analysis 13, 1976.
    """
    if n < 1:
        raise MethodError(f"number of points must be at least 1, got {n}")
    low, high = checked_box(lower, upper)
    shift = stream(seed, "space-filling points").random(low.size)
    lattice = np.outer(np.arange(n), _generating_vector(n, low.size)) % n / n
    return from_unit((lattice + shift) % 1, low, high)


def _generating_vector(n: int, dimensions: int) -> tuple[int, ...]:
    """Return the generating vector z of a lattice of `n` points, computed component by component.

    Each component is the number coprime to n for which the lattice, in the components so far, has the
    smallest worst-case error of integration in the Korobov space of smoothness 1 ([2] of `space_filling`),

        e² = -1 + 1/n Σ_k Π_j (1 + γ 2π² B({k z_j / n})),    B(x) = x² - x + 1/6.

    The weight γ of a component is 1/d. With γ = 1, the product over many components hides the distribution of
    the points in a few components: in 8 dimensions the discrepancy of 128 points is then 3 times as large.
    """
    numbers = np.arange(1, max(n, 2))
    units = numbers[np.gcd(numbers, n) == 1]
    units = units[:: -(-units.size // MOST_CANDIDATES)]
    x = np.outer(np.arange(n), units) % n / n
    factors = 1 + 2 * np.pi**2 / dimensions * (x * x - x + 1 / 6)
    product, vector = np.ones(n), []
    for _ in range(dimensions):
        # Rounded, so that the smaller of the equivalent numbers z and n - z is chosen on every machine.
        errors = np.round(product @ factors / np.sum(product), 12)
        best = int(np.argmin(errors))
        vector.append(int(units[best]))
        product = product * factors[:, best]
    return tuple(vector)
