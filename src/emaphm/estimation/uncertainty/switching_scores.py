"""What the chance of the switching adds to the covariance of an estimate, where motion is slow.

On a slow motion the shaft comes to rest again and again. Where it does, and when it breaks away, the ripple
of the current decides, which is another in each run. A position is then off by the same amount until the
shaft moves again: an error that lasts for hundreds of rows, of which a recording has as many as there are
rests. A fit takes up so few errors nearly all, and its residual does not show what they make of the estimate.
Runs of the reference model show it.
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
    """Return by how much runs of the reference model at an estimate differ from their mean.

    Weighted as the channels, (n, channel rows), and divided by √(n - 1): the squares of their products with
    the derivatives add up to the covariance that switching alone gives the scores. None of other than slow
    motions (`moves_slowly`), whose residual shows it, and of drives without a reference model.
    """
    objective = result.objective
    if not (moves_slowly(objective.problem) and has_reference(objective.problem)):
        return None
    reference = with_all_phases(reference_problem(objective))
    (runs,) = runs_about(objective, result.point[np.newaxis], reference, rng, REFERENCE_RUNS)
    rows = runs[:, : objective.channel_rows]
    return np.asarray((rows - rows.mean(axis=0)) / np.sqrt(len(rows) - 1))


def switching_scores(derivatives: Array, errors: Array | None) -> Array | float:
    """Return the covariance (d, d) that `switching_errors` give the scores by `derivatives` (d, rows)."""
    if errors is None:
        return 0.0
    scores = errors @ derivatives.T
    return np.asarray(scores.T @ scores)
