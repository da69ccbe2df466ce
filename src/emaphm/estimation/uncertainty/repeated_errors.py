"""What repetitions of one manoeuvre have in common in their residuals, and do not average away.

Noise is another in each recording, so that the scores (derivatives times residual) of n recordings add up as
independent ones, and standard errors fall as 1/√n. What the model lacks is the same each time: a friction
that depends on the position acts alike in all repetitions. Their scores of one instant then belong together,
and are added before their long-run covariance is taken, as a cluster's are (Liang and Zeger 1986; Driscoll
and Kraay 1998): n copies of one recording know no more than one.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.estimation.uncertainty.long_run_variance import long_run_covariance, slow_transforms
from emaphm.quantiles import normal_quantile

ALIKE = 0.1
"""Largest rms difference of two driving signals, relative to their spread, that repeat one manoeuvre."""

OVERLAP = 0.5
"""Least share of the longer recording that the shorter one repeats."""

CHANCE = 0.01
"""Probability with which independent residuals are taken for alike. What is then added is right all the same,
of fewer degrees of freedom."""


@dataclass(frozen=True, eq=False)
class ScoreSeries:
    """The `scores` (d, rows) of one recording, of all coordinates of a fit: 0 of those that are another's.

    `driving`, (rows,), is what the rows answer to: a command, or a motion. They are `interval` [s] apart.
    """

    scores: Array
    driving: Array
    interval: float


@dataclass(frozen=True, eq=False)
class RepeatedErrors:
    """The `covariance` (d, d) of the summed scores of all recordings, and what repetitions have in common.

    `independent`, (d, d), is what it would be if all recordings were independent. `correlation` is the mean
    correlation of their scores, of the repetitions that are most alike; None where no manoeuvre was repeated,
    or chance makes it. The recordings are of as many `manoeuvres`; `repetitions` has for each recording how
    many have its manoeuvre, itself included.
    """

    covariance: Array
    independent: Array
    correlation: float | None
    manoeuvres: int
    repetitions: tuple[int, ...]


def repeated_errors(
    series: Sequence[ScoreSeries], shared: NDArray[np.intp], rows_of_a_sum: int = 1
) -> RepeatedErrors:
    """Return the covariance of the scores of all recordings, those of repetitions added instant by instant.

    Recordings of other manoeuvres count as independent: what they share, their residuals do not show.

    Parameters
    ----------
    series
        One of each recording.
    shared
        The coordinates that all recordings have, by index.
    rows_of_a_sum
        Rows that are summed first, where only one of as many is not 0.
    """
    total, independent = np.zeros((2, len(series[0].scores), len(series[0].scores)))
    correlations = list[float]()
    groups = _repetitions(series)
    for group in groups:
        aligned = _summed(_aligned(group), rows_of_a_sum)
        correlation = _correlation(aligned[:, shared]) if len(group) > 1 else None
        apart = np.sum([long_run_covariance(_summed(one.scores, rows_of_a_sum)) for one in group], axis=0)
        independent += apart
        total += apart if correlation is None else long_run_covariance(aligned.sum(axis=0))
        correlations += [] if correlation is None else [correlation]
    count = {one: len(group) for group in groups for one in group}
    repetitions = tuple(count[one] for one in series)
    return RepeatedErrors(total, independent, max(correlations, default=None), len(groups), repetitions)


def _repetitions(series: Sequence[ScoreSeries]) -> list[list[ScoreSeries]]:
    """Return the recordings by manoeuvre, each with those that repeat its first one."""
    groups = list[list[ScoreSeries]]()
    for one in series:
        for group in groups:
            if _lag(group[0], one) is not None:
                group.append(one)
                break
        else:
            groups.append([one])
    return groups


def _lag(first: ScoreSeries, other: ScoreSeries) -> int | None:
    """Return by how many rows the `first` manoeuvre begins later in the `other`; None of another one."""
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
    alike = difference < ALIKE * min(float(np.std(a[:common])), float(np.std(b[:common])))
    return lag if alike and common >= OVERLAP * rows else None


def _aligned(group: Sequence[ScoreSeries]) -> Array:
    """Return the scores (n, d, rows) of a manoeuvre's recordings on one axis of time, 0 where none is."""
    lags = [_lag(group[0], one) or 0 for one in group[1:]]
    starts = np.array([0, *(-lag for lag in lags)])
    starts -= starts.min()
    ends = [start + one.driving.size for start, one in zip(starts, group, strict=True)]
    aligned = np.zeros((len(group), len(group[0].scores), max(ends)))
    for rows, start, end, one in zip(aligned, starts, ends, group, strict=True):
        rows[:, start:end] = one.scores
    return aligned


def _summed(scores: Array, count: int) -> Array:
    """Return `scores` (…, rows) summed over each `count` rows."""
    return np.asarray(np.add.reduceat(scores, np.arange(0, scores.shape[-1], count), axis=-1))


def _correlation(scores: Array) -> float | None:
    """Return the mean correlation between n series of `scores` (n, p, rows); None where chance makes as much.

    Of their slow cosine transforms, which the long-run covariance is made of, in units in which the
    covariance of all is the unit matrix: then 1 + (n - 1) ρ is what it makes of the variance of a sum. For
    independent series of K transforms, ρ has the variance 2 / (n (n - 1) p K).
    """
    count, p, _ = scores.shape
    transforms = np.array([slow_transforms(one) for one in scores])
    total = np.einsum("npk,nqk->pq", transforms, transforms)
    together = transforms.sum(axis=0)
    inflation = float(np.trace(np.linalg.pinv(total, hermitian=True) @ together @ together.T)) / p
    found = (inflation - 1) / (count - 1)
    by_chance = (2 / (count * (count - 1) * p * transforms.shape[2])) ** 0.5 * normal_quantile(1 - CHANCE)
    return found if found > by_chance else None
