"""Nuisances that explain a recording as well as the one that was selected: their share in its uncertainty.

A wrong inertia, a voltage and a current of a wrong scale look alike where friction, load and shorts are free.
One of them is reported; the others are less probable, and not excluded (model averaging: Hoeting, Madigan,
Raftery and Volinsky 1999).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.discrepancy import Discrepancy, discrepancies, reference_problem
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
    space = result.objective.space
    shifts = np.array([space.carried_over(one.point, one.objective.space) for one in others]) - result.point
    return replace(result, scatter=result.scatter + (weights * shifts.T) @ shifts)


def residual_power(result: SearchResult, like: SearchResult, seed: int) -> float:
    """Return the mean squared residual of `result` as `like` weights it, by `compared_anew`."""
    rows = like.objective.channel_rows
    means = [one.mean for one in compared_anew(result, seed)]
    residual = (result.objective.target - result.outputs - np.mean(means, axis=0))[:rows]
    ratios = like.objective.problem.weights / result.objective.problem.weights
    return float(np.mean((residual * np.repeat(ratios, like.objective.problem.samples)) ** 2))


def compared_anew(result: SearchResult, seed: int) -> list[Discrepancy]:
    """Return `COMPARED` new discrepancies at `result`.

    A mean over the usual number of runs of the reference model leaves 1 to 3 % of chance.
    """
    reference, rng = reference_problem(result.objective), stream(seed, "reference runs of rivals")
    point, outputs = result.point[np.newaxis], result.outputs[np.newaxis]
    return [discrepancies(result.objective, point, outputs, reference, rng)[0] for _ in range(COMPARED)]
