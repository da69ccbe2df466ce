"""The information that outputs have on parameters, from Jacobians with errors.

The kinks of stick-slip make errors of Jacobians, and the square of an error looks like information: of a
parameter without effect it may be all there is. Products of Jacobians taken about different points have no
such bias.
"""

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array


def information(jacobians: Array) -> Array:
    """Return the normal matrix (d, d) of `jacobians` (n, d, rows), free of the bias of their errors.

    The mean of J_i J_jᵀ over all pairs i ≠ j, made positive semidefinite; of one Jacobian (n = 1), its own
    product. Divided by the variance of white residuals it is Fisher's information.
    """
    return positive_semidefinite(_mean_over_pairs(products(jacobians)))


def information_lower_bound(jacobians: Array) -> Array:
    """Return the `information` (d, d) less its own standard error.

    Free of bias, the information is still of either sign by chance where the data have none. A standard
    error is subtracted along each of its axes, by the jackknife over the n replicates (Efron and Tibshirani
    1993, ch. 11); with two or fewer there is no error to estimate, and nothing is subtracted.
    """
    values, axes, along = _principal(products(jacobians))
    return np.asarray(axes * _lower_bounds(values, along) @ axes.T)


def normal_equations(jacobians: Array, residual: Array, sizes: Array) -> tuple[Array, Array]:
    """Return the normal matrix (d, d) of `jacobians` (n, d, rows), and their gradient (d,) by a `residual`.

    The normal matrix is free of the bias of the Jacobians' errors. Of the gradient, along each axis of the
    information in units of the parameters' `sizes` (d,), the share is left that is no error (a Wiener
    filter), where the information is no larger than its own standard error: of what the data do not show,
    the gradient would be error alone, and lead anywhere.
    """
    gradient = jacobians.mean(axis=0) @ residual
    values, axes, with_errors, shown = _shown(products(jacobians), sizes)
    shares = np.where(shown, 1.0, np.minimum(values / with_errors, 1.0))
    filtered = axes @ (shares * (axes.T @ (gradient * sizes)))
    return np.asarray((axes * values @ axes.T) / np.outer(sizes, sizes)), np.asarray(filtered / sizes)


def steadied_information(products: Array, sizes: Array) -> Array:
    """Return the normal matrix (d, d) of `products` (n, d, n, d) of Jacobians of several recordings together.

    As of `normal_equations`, but with the errors in where the information is no larger than its own standard
    error: that leaves the same share of the gradient's step. Several recordings may well show what the
    errors of one hide, and the prior of another's load, which is all that a matrix without the errors would
    have there, leads far away.
    """
    values, axes, with_errors, shown = _shown(products, sizes)
    steady = np.where(shown, values, np.maximum(values, with_errors))
    return np.asarray((axes * steady @ axes.T) / np.outer(sizes, sizes))


def _shown(products: Array, sizes: Array) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Return the information along its axes in units of `sizes`, and these (d, d).

    And the information with the Jacobians' errors in it, and where it is more than its own standard error.
    """
    values, axes, along = _principal(products * sizes[:, np.newaxis, np.newaxis] * sizes)
    with_errors = np.maximum(along.mean(axis=(1, 2)), np.finfo(float).tiny)
    return values, axes, with_errors, _lower_bounds(values, along) > 0


def _principal(products: Array) -> tuple[Array, Array, Array]:
    """Return the information along its axes (d,), these (d, d), and the `products` along each, (d, n, n)."""
    values, axes = np.linalg.eigh(positive_semidefinite(_mean_over_pairs(products)))
    return values, axes, np.einsum("da,idje,ea->aij", axes, products, axes, optimize=True)


def _lower_bounds(values: Array, along: Array) -> Array:
    """Return the information `values` (d,) less their standard errors, by the products `along` (d, n, n)."""
    count = along.shape[1]
    if count > 2:
        squares = np.diagonal(along, axis1=1, axis2=2)
        total = along.sum(axis=(1, 2)) - squares.sum(axis=1)
        # Without one replicate, all pairs that it is part of are gone.
        without = total[:, np.newaxis] - 2 * (along.sum(axis=2) - squares)
        means = without / ((count - 1) * (count - 2))
        values = values - np.sqrt((count - 1) * np.var(means, axis=1))
    return np.maximum(values, 0.0)


def products(jacobians: Array) -> Array:
    """Return J_i J_jᵀ of all pairs of `jacobians` (n, d, rows), shape (n, d, n, d)."""
    n, d, rows = jacobians.shape
    flat = jacobians.reshape(n * d, rows)
    return np.asarray((flat @ flat.T).reshape(n, d, n, d))


def _mean_over_pairs(products: Array) -> Array:
    count = len(products)
    squares: Array = np.einsum("idie->de", products)
    if count == 1:
        return squares
    return np.asarray((products.sum(axis=(0, 2)) - squares) / (count * (count - 1)))


def positive_semidefinite(matrix: Array) -> Array:
    """Return the symmetric positive semidefinite matrix nearest to `matrix` (d, d)."""
    values, axes = np.linalg.eigh((matrix + matrix.T) / 2)
    return np.asarray(axes * np.maximum(values, 0.0) @ axes.T)
