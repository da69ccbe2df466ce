"""Nuisances that explain a recording equally well: their contribution to the uncertainty of the selected one.

A wrong inertia, a wrong scale of the voltage and a wrong scale of the current have similar effects if
friction, load and shorts are free. One of them is reported; the others are less probable, but not excluded
(model averaging: Hoeting, Madigan, Raftery and Volinsky 1999).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.discrepancy import Discrepancy, discrepancies, reference_problem
from emaphm.estimation.search_result import SearchResult
from emaphm.random_streams import stream

COMPARED = 4
"""Number of batches of the usual runs of the reference model by which rivals are compared."""


def with_rivals(result: SearchResult, others: Sequence[SearchResult], improbabilities: Array) -> SearchResult:
    """Return `result` with the spread of `others` about it, weighted by probability, added to its scatter.

    `improbabilities` (others,) are -2 ln of their probabilities relative to `result`.
    """
    weights = np.exp(-np.maximum(improbabilities, 0.0) / 2)
    weights /= 1 + weights.sum()
    space = result.objective.space
    differences = (
        np.array([space.carried_over(rival.point, rival.objective.space) for rival in others]) - result.point
    )
    return replace(result, scatter=result.scatter + (weights * differences.T) @ differences)


def residual_power(result: SearchResult, like: SearchResult, seed: int) -> float:
    """Return the mean squared residual of `result` with the weights of `like`, by `compared_anew`."""
    rows = like.objective.channel_rows
    means = [discrepancy.mean for discrepancy in compared_anew(result, seed)]
    residual = (result.objective.target - result.outputs - np.mean(means, axis=0))[:rows]
    ratios = like.objective.problem.weights / result.objective.problem.weights
    return float(np.mean((residual * np.repeat(ratios, like.objective.problem.samples)) ** 2))


def compared_anew(result: SearchResult, seed: int) -> list[Discrepancy]:
    """Return `COMPARED` new discrepancies at `result`.

    The mean of the usual number of runs of the reference model has a random error of 1 to 3 %.
    """
    reference, rng = reference_problem(result.objective), stream(seed, "reference runs of rivals")
    point, outputs = result.point[np.newaxis], result.outputs[np.newaxis]
    return [discrepancies(result.objective, point, outputs, reference, rng)[0] for _ in range(COMPARED)]
