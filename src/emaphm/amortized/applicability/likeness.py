"""Test whether an estimator's answer is accepted: whether the recording is like the training set.

A network answers for any recording. Only a comparison with physics detects an answer that is wrong despite
its small uncertainty. Three statistics of a recording and its answer are compared with their values for
held-out simulations.

1. Two distances of the recording from the training set (`Projection.distances`).
2. The averaged model is run at sixteen points of the answer, in the time of one run, and the recording has to
   lie among these runs: for each channel

       ratio = rms(recorded - mean) / √(variance of the runs + noise² + (model error)²).

3. The predicted error of the answer. It is large if the residual is similar to that of a deviation which no
   simulation has, a delayed sensor for instance (`emaphm.amortized.error_prediction`).

A fourth test is for answers without a search: see `emaphm.amortized.applicability.delays`.
"""

from dataclasses import dataclass

import numpy as np

from emaphm.amortized.content import Limits
from emaphm.amortized.error_prediction.comparison import Comparison
from emaphm.amortized.estimator import Estimator
from emaphm.amortized.recording_setup import RecordingSetup
from emaphm.amortized.simulating import noise_rms
from emaphm.arrays import Array
from emaphm.estimation.signal_size import row_sizes


@dataclass(frozen=True)
class LikenessSettings:
    """Settings of the comparison of a recording with the training set.

    `model` is the error of the averaged model, relative to a channel's rms. A limit is the `quantile` of the
    statistic over held-out draws, times `margin`; that of the predicted error is `predicted_error_quantile`,
    without a margin. Draws beyond the limits mostly have heavy shorts: a full search for such a draw costs
    less than a wrong answer.
    """

    model: float = 0.02
    quantile: float = 0.99
    margin: float = 1.1
    predicted_error_quantile: float = 0.98


LIKENESS = LikenessSettings()


def predictive_ratios(setup: RecordingSetup, comparison: Comparison) -> Array:
    """Return the ratio of statistic 2 at the top of this file, (n, channels)."""
    rows, runs = comparison.rows, comparison.runs
    residual = np.mean((rows - runs[:, 0]) ** 2, axis=-1)
    variance = np.mean((runs[:, 1:] - runs[:, :1]) ** 2, axis=(1, 3))
    expected = variance + noise_rms(setup) ** 2 + LIKENESS.model**2 * row_sizes(setup.channels, rows) ** 2
    return np.asarray(np.sqrt(residual / np.maximum(expected, np.finfo(np.float32).tiny)), float)


@dataclass(frozen=True)
class Objections:
    """Objections to an answer, a clause each: `reasons` why it is not accepted, and why it is `rare`.

    A recording is rare if it is farther from the middle than most of the training set. If the model at its
    answer reproduces it nevertheless, the answer is still a good start of a search.
    """

    reasons: tuple[str, ...]
    rare: tuple[str, ...] = ()


def objections_to(estimator: Estimator, comparison: Comparison) -> Objections:
    """Return the objections to the answer for a recording; `comparison` is of this recording alone."""
    setup, limits, rows = estimator.setup, estimator.limits, comparison.rows
    statistics = (
        "its distance from the middle of the training set",
        "its residual from the principal components of the training set",
    )
    rare = tuple(
        f"{name} is larger than that of simulations ({distance:.3g}, at most {limit:.3g})"
        for name, distance, limit in zip(
            statistics, estimator.distances(rows)[0], limits.distances, strict=True
        )
        if not distance <= limit
    )
    reasons = [
        f"the residual of {name} at the answer is larger than the answer's own uncertainty allows "
        f"({ratio:.3g} times, at most {limit:.3g})"
        for name, ratio, limit in zip(
            setup.channels, predictive_ratios(setup, comparison)[0], limits.ratios, strict=True
        )
        if not ratio <= limit
    ]
    predicted = float(estimator.predicted_errors(comparison)[0])
    if not predicted <= limits.predicted_error:
        reasons.append(
            "the residual at the answer is like that of simulations with sensor errors or deviations from "
            "the description, for which answers are wrong "
            f"(predicted error {predicted:.3g} of the allowed one, at most {limits.predicted_error:.3g})"
        )
    return Objections(tuple(reasons), rare)


def limits_of(distances: Array, ratios: Array, predicted_errors: Array) -> Limits:
    """Return the limits from held-out `distances` (n, 2), `ratios` (n, channels), `predicted_errors` (n,)."""
    return Limits(
        LIKENESS.margin * np.quantile(distances, LIKENESS.quantile, axis=0),
        LIKENESS.margin * np.quantile(ratios, LIKENESS.quantile, axis=0),
        float(np.quantile(predicted_errors, LIKENESS.predicted_error_quantile)),
    )


def are_beyond(limits: Limits, distances: Array, ratios: Array, predicted_errors: Array) -> Array:
    """Return whether each of n draws is beyond a limit, (n,); arguments as for `limits_of`."""
    within = np.all(distances <= limits.distances, axis=1) & np.all(ratios <= limits.ratios, axis=1)
    return np.asarray(~(within & (predicted_errors <= limits.predicted_error)))
