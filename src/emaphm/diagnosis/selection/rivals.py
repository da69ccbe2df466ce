"""Nuisances that explain a recording as well as the one that was selected: their share in its uncertainty.

A wrong inertia, a voltage and a current of a wrong scale look alike where friction, load and shorts are free.
One of them is reported; the others are less probable, and not excluded (model averaging: Hoeting, Madigan,
Raftery and Volinsky 1999).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.discrepancy import discrepancies, reference_problem
from emaphm.estimation.search_result import SearchResult
from emaphm.random_streams import stream

COMPARED = 4
"""Times the usual runs of the reference model by which rivals are compared."""


def with_rivals(result: SearchResult, others: Sequence[SearchResult], improbabilities: Array) -> SearchResult:
    """Return `result`, its scatter larger by the spread of `others` about it, weighted by probability.

    `improbabilities` are -2 ln of how probable they are relative to `result`, (others,).
    """
    weights = np.exp(-np.maximum(improbabilities, 0.0) / 2)
    weights /= 1 + weights.sum()
    away = np.array([_coordinates(one, result) for one in others]) - result.point
    return replace(result, scatter=result.scatter + (weights * away.T) @ away)


def residual_power(result: SearchResult, like: SearchResult, seed: int) -> float:
    """Return the mean squared residual of `result` as `like` weights it, by `COMPARED` times as many runs.

    A mean over the usual number of runs of the reference model leaves 1 to 3 % of chance.
    """
    rows = like.objective.channel_rows
    reference, rng = reference_problem(result.objective), stream(seed, "reference runs of rivals")
    point, outputs = result.point[np.newaxis], result.outputs[np.newaxis]
    means = [discrepancies(result.objective, point, outputs, reference, rng)[0].mean for _ in range(COMPARED)]
    residual = (result.objective.target - result.outputs - np.mean(means, axis=0))[:rows]
    ratios = like.objective.problem.weights / result.objective.problem.weights
    return float(np.mean((residual * np.repeat(ratios, like.objective.problem.samples)) ** 2))


def _coordinates(other: SearchResult, result: SearchResult) -> Array:
    """Return the estimate of `other` in the coordinates (d,) of `result`: nominal, 0, where it lacks them."""
    values = dict(zip(other.objective.space.coordinates, other.point.tolist(), strict=True))
    return np.array([values.get(name, 0.0) for name in result.objective.space.coordinates])
