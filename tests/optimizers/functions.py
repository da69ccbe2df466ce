"""Test functions and boxes, as defined in the papers: points (n, d) to values (n,)."""

import numpy as np

from emaphm.arrays import Array

# Not a multiple of a tenth of the width from a bound, where a clipped swarm may arrive by chance.
CENTRE = 0.2134


def box(dimensions: int, half_width: float = 1.0) -> tuple[Array, Array]:
    """Return the bounds of the box with its centre at the origin."""
    return np.full(dimensions, -half_width), np.full(dimensions, half_width)


def sphere(points: Array) -> Array:
    """Return the squared distance to a point away from the origin and from the tenths of the box."""
    return squares(points - CENTRE)


def squares(points: Array) -> Array:
    """Return De Jong's first function, the sphere about the origin."""
    return np.asarray(np.sum(points**2, axis=1))


def rosenbrock(points: Array) -> Array:
    """Return Rosenbrock's valley, 0 at (1, ..., 1)."""
    x, following = points[:, :-1], points[:, 1:]
    return np.asarray(np.sum(100 * (following - x**2) ** 2 + (1 - x) ** 2, axis=1))


def rastrigin(points: Array) -> Array:
    """Return Rastrigin's function, 0 at the origin."""
    return np.asarray(np.sum(points**2 - 10 * np.cos(2 * np.pi * points) + 10, axis=1))


def griewank(points: Array) -> Array:
    """Return Griewank's function, 0 at the origin."""
    waves = np.cos(points / np.sqrt(np.arange(1, points.shape[1] + 1)))
    return np.asarray(np.sum(points**2, axis=1) / 4000 - np.prod(waves, axis=1) + 1)
