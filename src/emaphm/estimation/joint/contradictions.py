"""Parameters that the recordings of a campaign contradict each other in."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.estimation.joint.random_effects import random_effects
from emaphm.estimation.joint.uncertainty import AloneEstimates
from emaphm.quantiles import chi_squared_quantile, normal_quantile, student_t_quantile

CHANCE = 1e-3
"""Probability with which errors alone make a parameter look contradicted."""

MATERIAL = 0.02
"""Standard error, relative, that a contradiction must make to matter: the models' own differences leave some
percent between recordings."""

INFORMED = 0.5
"""A recording with a standard error above this share of the prior's says nothing of a parameter."""


FEWEST_OTHERS = 3
"""Recordings by whose scatter another's estimate is called an outlier: that of two says next to nothing."""


@dataclass(frozen=True, eq=False)
class Contradictions:
    """Which of p parameters are contradicted, (p,), and what covers it: a covariance (p, p) to be added.

    `informed`, (n, p), is whether each recording has information of its own on each parameter, `set_aside`,
    (n, p), whether that is an outlier, which has no part in the scatter.
    """

    contradicted: NDArray[np.bool_]
    informed: NDArray[np.bool_]
    covariance: Array
    set_aside: NDArray[np.bool_]


def contradictions_of_most(alone: AloneEstimates, prior_deviations: Array) -> Contradictions:
    """Return what the recordings contradict each other in, where one of many is off set aside.

    By parameter, an estimate that is farther from the meta-analysis of the others than chance explains, their
    scatter included, has no part in the scatter, if `FEWEST_OTHERS` have information on it. A joint fit still
    has that recording: how far it moves the weighted mean is added. `prior_deviations` (p,) are those of the
    shared parameters.
    """
    aside = np.zeros(alone.points.shape, bool)
    informed, variances = _informed(alone, prior_deviations)
    moved = np.zeros(prior_deviations.size)
    for j, prior in enumerate(prior_deviations):
        informative = np.flatnonzero(informed[:, j])
        agreeing = _agreeing(alone, informative, j, float(prior))
        aside[np.setdiff1d(informative, agreeing), j] = True
        if agreeing.size < informative.size:
            before, after = (
                np.average(alone.points[rows, j], weights=1 / variances[rows, j])
                for rows in (informative, agreeing)
            )
            moved[j] = before - after
    variance = np.where(aside, np.square(prior_deviations), 0.0)
    covariances = alone.covariances + variance[:, :, np.newaxis] * np.eye(prior_deviations.size)
    meta = random_effects(alone.points, covariances, prior_deviations)
    most = contradictions(replace(alone, covariances=covariances, meta=meta), prior_deviations)
    return replace(most, covariance=most.covariance + np.diag(moved**2), set_aside=aside)


def _informed(alone: AloneEstimates, prior_deviations: Array) -> tuple[NDArray[np.bool_], Array]:
    """Return whether each recording has information on each parameter, (n, p), and its variances."""
    variances = np.diagonal(alone.covariances, axis1=1, axis2=2)
    return variances < (INFORMED * prior_deviations) ** 2, variances


def _agreeing(alone: AloneEstimates, recordings: NDArray[np.intp], j: int, prior: float) -> NDArray[np.intp]:
    """Return which of the `recordings` are no outliers in parameter `j`: more than half of them."""
    left = recordings
    while left.size > FEWEST_OTHERS and 2 * (left.size - 1) > recordings.size:
        far = [_away(alone, int(r), left[left != r], j, prior) for r in left]
        if max(far) <= 1:
            break
        left = np.delete(left, int(np.argmax(far)))
    return left


def contradictions(alone: AloneEstimates, prior_deviations: Array) -> Contradictions:
    """Return what the estimates of each recording alone differ in by more than their errors explain.

    By parameter, Cochran's Q: squared deviations from the weighted mean of the recordings that have
    information, over their variances, is chi-squared where errors alone are at work. The covariance is that
    of the random-effects meta-analysis, and of a contradicted parameter at least the variance between the
    recordings, as wide as Student's t of so few values. `prior_deviations` (p,) are those of the shared
    parameters.
    """
    informed, variances = _informed(alone, prior_deviations)
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
    """Return which of the n recordings contradict the others, (n,).

    Each is left out of the others in turn; the one that is farthest from them in any parameter is named and
    removed, until the rest agree. Of two that remain, neither can be preferred: both are named.
    """
    found = np.zeros(len(alone.points), bool)
    while True:
        left = np.flatnonzero(~found)
        distances = np.array([_distance(alone, int(r), left[left != r], prior_deviations) for r in left])
        if left.size < 2 or distances.max() <= 1:
            return found
        found[left if left.size == 2 else left[np.argmax(distances)]] = True


def _distance(alone: AloneEstimates, r: int, others: NDArray[np.intp], prior_deviations: Array) -> float:
    """Return how far recording `r` is from the meta-analysis of the `others`, 1 where chance ends.

    By parameter: its own estimate less theirs, squared, over the variances of both is chi-squared where
    errors alone are at work; by Bonferroni's correction, `CHANCE` holds for all parameters and recordings
    together. All parameters at once would not do: along a collinear set, estimates lie far apart in a valley
    that is curved, so that the combination that each determines contradicts the others. A parameter without
    information, or a difference below `MATERIAL`, does not count.
    """
    if not others.size:
        return 0.0
    return max(
        _away(alone, r, others, j, float(prior), prior_deviations.size)
        for j, prior in enumerate(prior_deviations)
    )


def _away(
    alone: AloneEstimates, r: int, others: NDArray[np.intp], j: int, prior: float, parameters: int = 1
) -> float:
    """Return how far recording `r` is from the `others` in parameter `j`, of `parameters` tested."""
    limit = chi_squared_quantile(1, 1 - CHANCE / (parameters * (others.size + 1)))
    column = slice(j, j + 1)
    points, variances = alone.points[others, column], alone.covariances[others, column, column]
    meta = random_effects(points, variances, np.array([prior]))
    away = float(alone.points[r, j] - meta.mean[0])
    variance = float(alone.covariances[r, j, j] + meta.covariance[0, 0])
    if variance < (INFORMED * prior) ** 2 and abs(away) > MATERIAL:
        return away**2 / variance / limit
    return 0.0
