"""Regression of a residual on the derivatives by parameters that are not estimated."""

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.problem import Problem
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.uncertainty.local_covariance import rounding_scores
from emaphm.estimation.uncertainty.long_run_variance import long_run_covariance
from emaphm.estimation.uncertainty.switching_scores import switching_scores


def regressed(
    mean: Array, derivatives: Array, residual: Array, problem: Problem
) -> tuple[Array, Array, Array]:
    """Return the step (d,) of the estimate, the sizes (p,) of p further parameters, and their covariance.

    Partial regression (Frisch and Waugh 1933) of the `residual` (rows,) on the `derivatives` (p, rows) by the
    further parameters, after subtraction of their projection on the `mean` Jacobian (d, rows) of the
    estimated coordinates. For the covariance (p, p), the scores have the long-run covariance of the sandwich
    estimator, plus that of the rounding to counts in the channels of `problem`.
    """
    normal = mean @ mean.T
    # If the actuator stands, all derivatives may be 0.
    smallest = float(np.finfo(float).tiny)
    ridge = (1e-9 * float(np.trace(normal)) + smallest) * np.eye(len(normal))
    shares = np.linalg.solve(normal + ridge, mean @ derivatives.T)
    alone = derivatives - shares.T @ mean
    tiny = smallest * np.eye(len(alone))
    inverse = np.linalg.inv(alone @ alone.T + tiny)
    sizes = inverse @ (alone @ residual)
    scores = alone * (residual - sizes @ alone)
    scatter = long_run_covariance(scores, len(problem.channels)) + rounding_scores(problem, alone) + tiny
    return -(shares @ sizes), sizes, inverse @ scatter @ inverse


def answered_sizes(
    result: SearchResult,
    fitted: tuple[Array, Array],
    answered: tuple[Array, Array],
    errors: Array | None = None,
) -> tuple[Array, Array]:
    """Return the sizes (p,) of p further parameters from an estimate's residual, and their covariance (p, p).

    `fitted` are the derivatives of the fitted model by the estimated coordinates, (d, channel rows), and by
    the p further parameters, (p, channel rows); `answered` are those of the reference model. The recording
    has the derivatives D of the reference model, while the estimate uses those of the fitted model as
    instrumental variables Z (Sargan 1958):

        x = (Z Dᵀ + P)⁻¹ (Z r - P θ)

    The random switching of the reference model causes no bias, because the instruments do not contain it. P
    is the weight of the priors, under which θ has its prior scatter. The covariance includes the scores of
    the switching `errors` (n, channel rows), from `switching_errors`.
    """
    objective, count = result.objective, len(fitted[1])
    residual = result.residual[: objective.channel_rows]
    instruments, responses = np.vstack(fitted), np.vstack(answered)
    deviations, estimated = objective.space.prior_deviations, np.arange(objective.space.dimensions)
    weights = float(np.mean(residual**2)) * objective.rows_of_priors / deviations**2
    # A fault has no prior mean: its prior acts about its current value.
    prior_gradient = weights * np.where(estimated < len(objective.space.columns), 0.0, result.point)
    normal = instruments @ responses.T
    normal[estimated, estimated] += weights
    inverse = np.linalg.inv(normal + float(np.finfo(float).tiny) * np.eye(len(normal)))
    sizes = inverse @ (instruments @ residual - np.append(prior_gradient, np.zeros(count)))
    scores = instruments * (residual - sizes @ responses)
    scatter = long_run_covariance(scores, len(objective.problem.channels))
    scatter = scatter + rounding_scores(objective.problem, instruments)
    scatter = scatter + switching_scores(instruments, errors)
    scatter[estimated, estimated] += (weights * deviations) ** 2
    covariance = inverse @ scatter @ inverse.T
    return sizes[-count:], covariance[-count:, -count:]


def size_of_one(result: SearchResult, jacobians: Array, derivative: Array) -> tuple[float, float]:
    """Return the size of one further parameter from the residual of an estimate, and its standard error.

    `derivative` (channel rows,) is that by the further parameter; `jacobians` (n, d, channel rows) are those
    by the estimated coordinates.
    """
    objective = result.objective
    residual = result.residual[: objective.channel_rows]
    mean = jacobians.mean(axis=0)
    _, sizes, covariance = regressed(mean, derivative[np.newaxis], residual, objective.problem)
    return float(sizes[0]), float(covariance[0, 0] ** 0.5)
