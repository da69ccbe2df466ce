"""What a residual shows of parameters that are not estimated: a regression on their derivatives."""

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
    """Return the step (d,) of the others, the sizes (p,) of p more coordinates, and their covariance (p, p).

    By regression of the `residual` (rows,) on the `derivatives` (p, rows) less what the other coordinates,
    whose `mean` Jacobian is (d, rows), explain of them (Frisch and Waugh 1933); the scores are as correlated
    as the sandwich covariance takes them, with what counts of the channels of `problem` leave open.
    """
    normal = mean @ mean.T
    # An actuator that stands may answer to nothing at all.
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
    """Return the sizes (p,) of p more parameters that an estimate's residual shows, and their covariance.

    `fitted` are the derivatives of the fitted model by what is estimated, (d, channel rows), and by the p
    others, (p, channel rows); `answered` are those of the reference model. The recording answers by these,
    while the estimate follows the others: a regression by instrumental variables Z (Sargan 1958),

        x = (Z Dᵀ + P)⁻¹ (Z r - P θ),

    in which the chance of the reference model's switching, which the instruments have not, makes no bias. P
    is the weight of the priors, about which θ scatters as they say. The covariance is (p, p), with what the
    `errors` (n, channel rows) of the switching make of the scores (`switching_errors`).
    """
    objective, more = result.objective, len(fitted[1])
    residual = result.residual[: objective.channel_rows]
    instruments, answers = np.vstack(fitted), np.vstack(answered)
    deviations, own = objective.space.prior_deviations, np.arange(objective.space.dimensions)
    weights = float(np.mean(residual**2)) * objective.rows_of_priors / deviations**2
    # A fault is drawn to where it is: it has no mean beforehand.
    drawn = weights * np.where(own < len(objective.space.columns), 0.0, result.point)
    normal = instruments @ answers.T
    normal[own, own] += weights
    inverse = np.linalg.inv(normal + float(np.finfo(float).tiny) * np.eye(len(normal)))
    sizes = inverse @ (instruments @ residual - np.append(drawn, np.zeros(more)))
    scores = instruments * (residual - sizes @ answers)
    scatter = long_run_covariance(scores, len(objective.problem.channels))
    scatter = scatter + rounding_scores(objective.problem, instruments)
    scatter = scatter + switching_scores(instruments, errors)
    scatter[own, own] += (weights * deviations) ** 2
    covariance = inverse @ scatter @ inverse.T
    return sizes[-more:], covariance[-more:, -more:]


def size_of_one(result: SearchResult, jacobians: Array, derivative: Array) -> tuple[float, float]:
    """Return the size of one more parameter that the residual of an estimate shows, and its standard error.

    By its `derivative` (channel rows,), and the `jacobians` (n, d, channel rows) of what is estimated.
    """
    objective = result.objective
    residual = result.residual[: objective.channel_rows]
    mean = jacobians.mean(axis=0)
    _, sizes, covariance = regressed(mean, derivative[np.newaxis], residual, objective.problem)
    return float(sizes[0]), float(covariance[0, 0] ** 0.5)
