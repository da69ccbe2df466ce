"""Contradictions between the recordings of a campaign in single parameters."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.estimation.joint.random_effects import random_effects
from emaphm.estimation.joint.uncertainty import AloneEstimates
from emaphm.quantiles import chi_squared_quantile, normal_quantile, student_t_quantile

CHANCE = 1e-3
"""Probability of a false contradiction of a parameter due to errors alone."""

MATERIAL = 0.02
"""Least relative standard error due to a contradiction for it to count: differences of the models cause some
percent between recordings."""

INFORMED = 0.5
"""Standard error, relative to the prior's, above which a recording has no information on a parameter."""

FEWEST_OTHERS = 3
"""Least number of recordings whose scatter can identify another estimate as an outlier."""


@dataclass(frozen=True, eq=False)
class Contradictions:
    """Whether each of p parameters is contradicted, (p,), and the `covariance` (p, p) to be added for it.

    `informed`, (n, p), states whether each recording has information of its own on each parameter;
    `set_aside`, (n, p), whether its estimate is an outlier, which is excluded from the scatter.
    """

    contradicted: NDArray[np.bool_]
    informed: NDArray[np.bool_]
    covariance: Array
    set_aside: NDArray[np.bool_]


def contradictions_of_most(alone: AloneEstimates, prior_deviations: Array) -> Contradictions:
    """Return the contradictions between the recordings after single outliers are set aside.

    For each parameter, an estimate whose distance from the meta-analysis of the others is significant,
    including their scatter, is excluded from the scatter if at least `FEWEST_OTHERS` recordings have
    information on it. A joint fit still contains that recording: the shift of the weighted mean is added to
    the covariance.
    """
    set_aside = np.zeros(alone.points.shape, bool)
    informed, variances = _informed_recordings(alone, prior_deviations)
    shifts = np.zeros(prior_deviations.size)
    for j, prior in enumerate(prior_deviations):
        candidates = np.flatnonzero(informed[:, j])
        agreeing = _agreeing(alone, candidates, j, float(prior))
        set_aside[np.setdiff1d(candidates, agreeing), j] = True
        if agreeing.size < candidates.size:
            means = [
                np.average(alone.points[group, j], weights=1 / variances[group, j])
                for group in (candidates, agreeing)
            ]
            shifts[j] = means[0] - means[1]
    variance = np.where(set_aside, np.square(prior_deviations), 0.0)
    covariances = alone.covariances + variance[:, :, np.newaxis] * np.eye(prior_deviations.size)
    meta = random_effects(alone.points, covariances, prior_deviations)
    of_most = contradictions(replace(alone, covariances=covariances, meta=meta), prior_deviations)
    return replace(of_most, covariance=of_most.covariance + np.diag(shifts**2), set_aside=set_aside)


def _informed_recordings(alone: AloneEstimates, prior_deviations: Array) -> tuple[NDArray[np.bool_], Array]:
    """Return whether each recording has information on each parameter, (n, p), and the variances (n, p)."""
    variances = np.diagonal(alone.covariances, axis1=1, axis2=2)
    return variances < (INFORMED * prior_deviations) ** 2, variances


def _agreeing(alone: AloneEstimates, candidates: NDArray[np.intp], j: int, prior: float) -> NDArray[np.intp]:
    """Return the recordings of `candidates` that are no outliers in parameter `j`: more than half of them."""
    agreeing = candidates
    while agreeing.size > FEWEST_OTHERS and 2 * (agreeing.size - 1) > candidates.size:
        distances = [
            _distance_in_parameter(alone, int(r), agreeing[agreeing != r], j, prior) for r in agreeing
        ]
        if max(distances) <= 1:
            break
        agreeing = np.delete(agreeing, int(np.argmax(distances)))
    return agreeing


def contradictions(alone: AloneEstimates, prior_deviations: Array) -> Contradictions:
    """Return the parameters in which the estimates of single recordings differ by more than their errors.

    The test of each parameter is Cochran's Q: the sum of squared deviations from the weighted mean of the
    informed recordings, divided by their variances, is chi-squared if there are only errors. The covariance
    is that of the random-effects meta-analysis; for a contradicted parameter, it is at least the variance
    between the recordings, widened by Student's t of their number.
    """
    informed, variances = _informed_recordings(alone, prior_deviations)
    contradicted = np.zeros(prior_deviations.size, bool)
    covariance = alone.meta.scatter.copy()
    for j in np.flatnonzero(informed.sum(axis=0) > 1):
        values, weights = alone.points[informed[:, j], j], 1 / variances[informed[:, j], j]
        freedom = values.size - 1
        square = float(weights @ (values - weights @ values / weights.sum()) ** 2)
        if square > chi_squared_quantile(freedom, 1 - CHANCE):
            wider = student_t_quantile(freedom, 0.975) / float(normal_quantile(0.975))
            least = float(np.var(values, ddof=1)) * wider**2
            covariance[j, j] = max(covariance[j, j], least)
            contradicted[j] = covariance[j, j] > MATERIAL**2
    return Contradictions(contradicted, informed, covariance, np.zeros_like(informed))


def dissenting(alone: AloneEstimates, prior_deviations: Array) -> NDArray[np.bool_]:
    """Return whether each of the n recordings contradicts the others, (n,).

    Each recording is compared with all others; the recording with the largest distance in any parameter is
    marked and removed, until the remaining recordings agree. If two remain that contradict each other, both
    are marked, because neither can be preferred.
    """
    marked = np.zeros(len(alone.points), bool)
    while True:
        remaining = np.flatnonzero(~marked)
        distances = np.array(
            [_distance(alone, int(r), remaining[remaining != r], prior_deviations) for r in remaining]
        )
        if remaining.size < 2 or distances.max() <= 1:
            return marked
        marked[remaining if remaining.size == 2 else remaining[np.argmax(distances)]] = True


def _distance(alone: AloneEstimates, r: int, others: NDArray[np.intp], prior_deviations: Array) -> float:
    """Return the distance of recording `r` from the meta-analysis of the `others`; it is significant above 1.

    It is the largest over the parameters: the squared difference of the two estimates divided by the sum of
    their variances, which is chi-squared if there are only errors. With Bonferroni's correction, `CHANCE`
    holds for all parameters and recordings together. A test of all parameters at once would not work: along a
    collinear set, estimates scatter along a curved valley, so that the combinations that they determine
    contradict each other. A parameter without information, or a difference below `MATERIAL`, does not count.
    """
    if not others.size:
        return 0.0
    return max(
        _distance_in_parameter(alone, r, others, j, float(prior), prior_deviations.size)
        for j, prior in enumerate(prior_deviations)
    )


def _distance_in_parameter(
    alone: AloneEstimates, r: int, others: NDArray[np.intp], j: int, prior: float, parameters: int = 1
) -> float:
    """Return the distance of recording `r` from the `others` in parameter `j`, of `parameters` tested."""
    limit = chi_squared_quantile(1, 1 - CHANCE / (parameters * (others.size + 1)))
    column = slice(j, j + 1)
    points, variances = alone.points[others, column], alone.covariances[others, column, column]
    meta = random_effects(points, variances, np.array([prior]))
    difference = float(alone.points[r, j] - meta.mean[0])
    variance = float(alone.covariances[r, j, j] + meta.covariance[0, 0])
    if variance < (INFORMED * prior) ** 2 and abs(difference) > MATERIAL:
        return difference**2 / variance / limit
    return 0.0
