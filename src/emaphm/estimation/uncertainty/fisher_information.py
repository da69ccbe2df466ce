"""Fisher's information of outputs on parameters, from Jacobians with errors.

Kinks of stick-slip cause errors of Jacobians, and the square of an error counts as information: for a
parameter without effect, the information may consist of errors only. Products of Jacobians about different
points do not have this bias.
"""

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array


def information(jacobians: Array) -> Array:
    """Return the normal matrix (d, d) of `jacobians` (n, d, rows) without the bias from their errors.

    It is the mean of J_i J_jᵀ over all pairs i ≠ j, made positive semidefinite; J Jᵀ for a single Jacobian
    (n = 1). Divided by the variance of white residuals it is Fisher's information.
    """
    return positive_semidefinite(_mean_over_pairs(products(jacobians)))


def information_lower_bound(jacobians: Array) -> Array:
    """Return the `information` (d, d) minus its own standard error.

    Where the data have no information, the unbiased estimate is positive or negative by chance. The standard
    error is therefore subtracted along each of its axes, from the jackknife over the n replicates (Efron and
    Tibshirani 1993, ch. 11). With two replicates or fewer, the error cannot be estimated and is not
    subtracted.
    """
    values, axes, projected = _principal_axes(products(jacobians))
    return np.asarray(axes * _lower_bounds(values, projected) @ axes.T)


def normal_equations(jacobians: Array, residual: Array, sizes: Array) -> tuple[Array, Array]:
    """Return the normal matrix (d, d) of `jacobians` (n, d, rows), and J r (d,) for a `residual` r (rows,).

    The normal matrix does not have the bias from the Jacobians' errors. The axes of the information are taken
    in units of the parameters' `sizes` (d,). Along an axis whose information is within its own standard
    error, the gradient is multiplied by the share of the information that is not error (Wiener filter):
    otherwise the gradient along unidentified axes would consist of errors, and the step would be arbitrary.
    """
    gradient = jacobians.mean(axis=0) @ residual
    values, axes, with_errors, significant = _scaled_axes(products(jacobians), sizes)
    shares = np.where(significant, 1.0, np.minimum(values / with_errors, 1.0))
    filtered = axes @ (shares * (axes.T @ (gradient * sizes)))
    return np.asarray((axes * values @ axes.T) / np.outer(sizes, sizes)), np.asarray(filtered / sizes)


def steadied_information(products: Array, sizes: Array) -> Array:
    """Return the normal matrix (d, d) from `products` (n, d, n, d) of Jacobians, summed over recordings.

    It is that of `normal_equations`, except that along axes whose information is within its own standard
    error, the errors are included: this has the same effect on the step as the filtered gradient. Several
    recordings together may identify an axis that errors hide in a single recording. Without the errors, the
    matrix along such an axis could contain only the prior of another recording's load, and the step would be
    much too long.
    """
    values, axes, with_errors, significant = _scaled_axes(products, sizes)
    steady = np.where(significant, values, np.maximum(values, with_errors))
    return np.asarray((axes * steady @ axes.T) / np.outer(sizes, sizes))


def _scaled_axes(products: Array, sizes: Array) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Return the principal axes of the information in units of `sizes` (d,).

    The results are the information along each axis (d,), the axes (d, d), the information including the
    Jacobians' errors (d,), and whether the information exceeds its own standard error (d,).
    """
    values, axes, projected = _principal_axes(products * sizes[:, np.newaxis, np.newaxis] * sizes)
    with_errors = np.maximum(projected.mean(axis=(1, 2)), np.finfo(float).tiny)
    return values, axes, with_errors, _lower_bounds(values, projected) > 0


def _principal_axes(products: Array) -> tuple[Array, Array, Array]:
    """Return the information along its axes (d,), the axes (d, d), and `products` along each (d, n, n)."""
    values, axes = np.linalg.eigh(positive_semidefinite(_mean_over_pairs(products)))
    return values, axes, np.einsum("da,idje,ea->aij", axes, products, axes, optimize=True)


def _lower_bounds(values: Array, projected: Array) -> Array:
    """Return the information `values` (d,) minus their standard errors, at least 0.

    `projected` (d, n, n) are the products of the replicates along each axis.
    """
    count = projected.shape[1]
    if count > 2:
        squares = np.diagonal(projected, axis1=1, axis2=2)
        total = projected.sum(axis=(1, 2)) - squares.sum(axis=1)
        # Leaving out a replicate removes all pairs that contain it.
        without = total[:, np.newaxis] - 2 * (projected.sum(axis=2) - squares)
        means = without / ((count - 1) * (count - 2))
        values = values - np.sqrt((count - 1) * np.var(means, axis=1))
    return np.maximum(values, 0.0)


def products(jacobians: Array) -> Array:
    """Return J_i J_jᵀ of all pairs of `jacobians` (n, d, rows), shape (n, d, n, d)."""
    n, d, rows = jacobians.shape
    flat = jacobians.reshape(n * d, rows)
    return np.asarray((flat @ flat.T).reshape(n, d, n, d))


def _mean_over_pairs(products: Array) -> Array:
    """Return the mean (d, d) of `products` (n, d, n, d) over all pairs of different replicates."""
    count = len(products)
    squares: Array = np.einsum("idie->de", products)
    if count == 1:
        return squares
    return np.asarray((products.sum(axis=(0, 2)) - squares) / (count * (count - 1)))


def positive_semidefinite(matrix: Array) -> Array:
    """Return the symmetric positive semidefinite matrix nearest to `matrix` (d, d)."""
    values, axes = np.linalg.eigh((matrix + matrix.T) / 2)
    return np.asarray(axes * np.maximum(values, 0.0) @ axes.T)
