"""Covariance of an estimate due to random switching in slow motions.

In a slow motion the shaft comes to rest repeatedly. The ripple of the current, which differs between runs,
determines where it stops and when it breaks away. The position error is then constant until the shaft moves
again: it lasts for hundreds of rows, and a recording has only one such error per rest. A fit absorbs almost
all of so few errors, and its residual does not show their effect on the estimate. The effect is therefore
determined from runs of the reference model.
"""

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.discrepancy import (
    REFERENCE_RUNS,
    has_reference,
    reference_problem,
    runs_about,
    with_all_phases,
)
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.uncertainty.local_covariance import moves_slowly


def switching_errors(result: SearchResult, rng: np.random.Generator) -> Array | None:
    """Return the deviations (n, channel rows) of n reference-model runs at an estimate from their mean.

    They have the weights of the channels and are divided by √(n - 1): the sum of the squares of their
    products with the derivatives is the covariance of the scores due to switching. None for faster motions
    (see `moves_slowly`), whose residual contains the effect, and for drives without a reference model.
    """
    objective = result.objective
    if not (moves_slowly(objective.problem) and has_reference(objective.problem)):
        return None
    reference = with_all_phases(reference_problem(objective))
    (runs,) = runs_about(objective, result.point[np.newaxis], reference, rng, REFERENCE_RUNS)
    rows = runs[:, : objective.channel_rows]
    return np.asarray((rows - rows.mean(axis=0)) / np.sqrt(len(rows) - 1))


def switching_scores(derivatives: Array, errors: Array | None) -> Array | float:
    """Return the covariance (d, d) of the scores of `switching_errors`, with the `derivatives` (d, rows)."""
    if errors is None:
        return 0.0
    scores = errors @ derivatives.T
    return np.asarray(scores.T @ scores)
