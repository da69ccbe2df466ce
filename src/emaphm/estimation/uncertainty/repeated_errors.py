"""Common errors in the residuals of repetitions of one manoeuvre, which averaging does not reduce.

Noise differs between recordings, so the scores (derivatives times residual) of n recordings are independent,
and standard errors fall as 1/√n. Unmodelled effects are equal in each repetition, for example a friction that
depends on the position. The scores of one instant are therefore added over the repetitions before their
long-run covariance is computed, as for clustered data (Liang and Zeger 1986; Driscoll and Kraay 1998): n
copies of one recording have the information of one recording.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.estimation.uncertainty.long_run_variance import long_run_covariance, slow_transforms
from emaphm.quantiles import normal_quantile

ALIKE = 0.1
"""Largest rms difference of two driving signals of one manoeuvre, relative to their standard deviation."""

OVERLAP = 0.5
"""Least overlap of two repetitions, relative to the longer recording."""

CHANCE = 0.01
"""Probability that independent residuals count as correlated. The covariance of their sum is then still
correct, with fewer degrees of freedom."""


@dataclass(frozen=True, eq=False)
class ScoreSeries:
    """The `scores` (d, rows) of one recording for all coordinates of a fit.

    Scores of coordinates of other recordings are 0. `driving`, (rows,), is the driving signal of the rows: a
    command or a motion. Rows are `interval` [s] apart.
    """

    scores: Array
    driving: Array
    interval: float


@dataclass(frozen=True, eq=False)
class RepeatedErrors:
    """The `covariance` (d, d) of the summed scores of all recordings, and the correlation of repetitions.

    `independent`, (d, d), is the covariance for independent recordings. `correlation` is the mean correlation
    of the scores of the most correlated manoeuvre; None if no manoeuvre was repeated, or if the correlation
    is not significant. `manoeuvres` is the number of different manoeuvres; `repetitions` states for each
    recording the number of recordings with its manoeuvre, including itself.
    """

    covariance: Array
    independent: Array
    correlation: float | None
    manoeuvres: int
    repetitions: tuple[int, ...]


def repeated_errors(
    series: Sequence[ScoreSeries], shared: NDArray[np.intp], rows_of_a_sum: int = 1
) -> RepeatedErrors:
    """Return the covariance of the scores of all recordings; scores of repetitions are added row by row.

    Recordings of different manoeuvres count as independent, because their residuals do not show a common
    error.

    Parameters
    ----------
    series
        The score series of each recording.
    shared
        Indices of the coordinates that all recordings have.
    rows_of_a_sum
        Number of rows that are summed first, if only one of as many rows is not 0.
    """
    total, independent = np.zeros((2, len(series[0].scores), len(series[0].scores)))
    correlations = list[float]()
    groups = _repetitions(series)
    for group in groups:
        aligned = _summed(_aligned(group), rows_of_a_sum)
        correlation = _correlation(aligned[:, shared]) if len(group) > 1 else None
        separate = np.sum(
            [long_run_covariance(_summed(member.scores, rows_of_a_sum)) for member in group], axis=0
        )
        independent += separate
        total += separate if correlation is None else long_run_covariance(aligned.sum(axis=0))
        correlations += [] if correlation is None else [correlation]
    count = {member: len(group) for group in groups for member in group}
    repetitions = tuple(count[recording] for recording in series)
    return RepeatedErrors(total, independent, max(correlations, default=None), len(groups), repetitions)


def _repetitions(series: Sequence[ScoreSeries]) -> list[list[ScoreSeries]]:
    """Return the recordings grouped by manoeuvre, each group with the repetitions of its first recording."""
    groups = list[list[ScoreSeries]]()
    for recording in series:
        for group in groups:
            if _lag(group[0], recording) is not None:
                group.append(recording)
                break
        else:
            groups.append([recording])
    return groups


def _lag(first: ScoreSeries, other: ScoreSeries) -> int | None:
    """Return the lag in rows of the `first` manoeuvre in `other`; None if `other` has another manoeuvre."""
    rows = max(first.driving.size, other.driving.size)
    if abs(other.interval / first.interval - 1) * rows > 0.5:
        return None
    a, b = first.driving - first.driving.mean(), other.driving - other.driving.mean()
    size = a.size + b.size
    products = np.fft.irfft(np.fft.rfft(a, size).conj() * np.fft.rfft(b, size), size)
    best = int(np.argmax(products))
    lag = best if best < b.size else best - size
    a, b = a[max(-lag, 0) :], b[max(lag, 0) :]
    common = min(a.size, b.size)
    difference = float(np.std(a[:common] - b[:common]))
    is_repetition = difference < ALIKE * min(float(np.std(a[:common])), float(np.std(b[:common])))
    return lag if is_repetition and common >= OVERLAP * rows else None


def _aligned(group: Sequence[ScoreSeries]) -> Array:
    """Return the scores (n, d, rows) of a manoeuvre's recordings on a common time axis, 0 outside each."""
    lags = [_lag(group[0], repetition) or 0 for repetition in group[1:]]
    starts = np.array([0, *(-lag for lag in lags)])
    starts -= starts.min()
    ends = [start + recording.driving.size for start, recording in zip(starts, group, strict=True)]
    aligned = np.zeros((len(group), len(group[0].scores), max(ends)))
    for rows, start, end, recording in zip(aligned, starts, ends, group, strict=True):
        rows[:, start:end] = recording.scores
    return aligned


def _summed(scores: Array, count: int) -> Array:
    """Return `scores` (…, rows) summed over blocks of `count` rows."""
    return np.asarray(np.add.reduceat(scores, np.arange(0, scores.shape[-1], count), axis=-1))


def _correlation(scores: Array) -> float | None:
    """Return the mean correlation between n series of `scores` (n, p, rows); None if it is not significant.

    It is the correlation ρ of their slow cosine transforms, from which the long-run covariance is computed,
    in units in which the covariance of all series is the unit matrix: 1 + (n - 1) ρ is then the factor on the
    variance of the sum. For independent series of K transforms, ρ has the variance 2 / (n (n - 1) p K).
    """
    count, p, _ = scores.shape
    transforms = np.array([slow_transforms(recording) for recording in scores])
    total = np.einsum("npk,nqk->pq", transforms, transforms)
    summed = transforms.sum(axis=0)
    inflation = float(np.trace(np.linalg.pinv(total, hermitian=True) @ summed @ summed.T)) / p
    correlation = (inflation - 1) / (count - 1)
    by_chance = (2 / (count * (count - 1) * p * transforms.shape[2])) ** 0.5 * normal_quantile(1 - CHANCE)
    return correlation if correlation > by_chance else None
