"""What the neighbourhood of a point tells: how sure it is, and where a Gauss-Newton step leads from it."""

from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.covariance import knowledge
from emaphm.estimation.levenberg_marquardt import scattered
from emaphm.estimation.objective import CORRELATED_ROWS, Fit

DERIVATIVE_STEP, DERIVATIVES = 1e-2, 8
"""Step of the differences that uncertainty is told from, and how often they are taken."""


@dataclass(frozen=True, eq=False)
class Neighbourhood:
    """The `covariance` (d, d) of the least squares at a point, and a Gauss-Newton `step` (d,) from it."""

    covariance: Array
    step: Array


def slopes(fit: Fit, point: Array, seed: int) -> tuple[Array, int]:
    """Return derivatives (n, d, recorded rows) about `point` (d,), and the simulations spent."""
    rows = fit.recorded_rows
    return scattered(
        lambda points: fit.outputs(points)[:, :rows], point, fit.space, DERIVATIVE_STEP, DERIVATIVES, seed
    )


def neighbourhood(
    fit: Fit, point: Array, residual: Array, derivatives: Array, bias: Array | float = 0.0
) -> Neighbourhood:
    """Return what `derivatives` about `point` (d,) tell where `residual` (recorded rows,) is left.

    The step is towards the optimum, `bias` being what of the residual is known to be the model's.
    """
    faults, deviations = len(fit.space.columns), fit.space.prior_deviations
    known = knowledge(derivatives, residual, deviations, len(fit.problem.channels))
    gradient = derivatives.mean(axis=0) @ (residual - bias) / np.mean(residual**2)
    prior = CORRELATED_ROWS / deviations**2
    gradient[faults:] -= prior[faults:] * point[faults:]
    step = np.linalg.solve(known.information + np.diag(prior), gradient)
    return Neighbourhood(known.covariance, step)
