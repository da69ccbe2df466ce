"""When an estimator is not to be believed: recordings unlike those that it was trained on.

What a recording and its answer show is compared with what held-out simulations do, in three ways.

1. Two distances of the recording alone from the training set (`Projection.distances`).
2. Sixteen points of the answer are run by the averaged model, at the price of one, and the recording has to
   lie among them: for each channel

       ratio = rms(recorded - mean) / √(variance of the runs + noise² + (model error)²).

3. What is left of the recording may look like what no simulation has, a late sensor for instance
   (`emaphm.amortized.error_prediction`).

A fourth is for answers that no search follows: see `emaphm.amortized.applicability.delays`.

A network answers whatever it is asked; only a comparison with physics shows an answer that is sure and wrong.
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
    """How a recording is compared with the training set.

    The averaged model's error `model`, relative to a channel's rms; and limits: the `quantile` of held-out
    draws, times `margin`. Beyond are draws with heavy shorts, mostly: a full search for one of them costs
    less than a wrong answer. That of the predicted error is its own quantile.
    """

    model: float = 0.02
    quantile: float = 0.99
    margin: float = 1.1
    predicted_error_quantile: float = 0.98


LIKENESS = LikenessSettings()


def predictive_ratios(setup: RecordingSetup, comparison: Comparison) -> Array:
    """Return the ratio at the top of this file, (n, channels)."""
    rows, runs = comparison.rows, comparison.runs
    residual = np.mean((rows - runs[:, 0]) ** 2, axis=-1)
    variance = np.mean((runs[:, 1:] - runs[:, :1]) ** 2, axis=(1, 3))
    expected = variance + noise_rms(setup) ** 2 + LIKENESS.model**2 * row_sizes(setup.channels, rows) ** 2
    return np.asarray(np.sqrt(residual / np.maximum(expected, np.finfo(np.float32).tiny)), float)


@dataclass(frozen=True)
class Unlikeness:
    """What speaks against an answer, a clause each: `reasons` not to believe it, and what makes it `rare`.

    A recording may be rare, farther out than most of the training set, and the model at its answer reproduce
    it all the same. The answer is then a start for a search as good as any.
    """

    reasons: tuple[str, ...]
    rare: tuple[str, ...] = ()


def unlikeness(estimator: Estimator, comparison: Comparison) -> Unlikeness:
    """Return what speaks against the answer for a recording, of which `comparison` is, the only one."""
    setup, limits, rows = estimator.setup, estimator.limits, comparison.rows
    what = ("farther from the middle of the training set", "of another shape than the training set")
    rare = tuple(
        f"the recording is {text} than simulations are ({distance:.3g}, at most {limit:.3g})"
        for text, distance, limit in zip(what, estimator.distances(rows)[0], limits.distances, strict=True)
        if not distance <= limit
    )
    found = [
        f"the model at its answer is farther from {name} than the answer's own uncertainty allows "
        f"({ratio:.3g} times, at most {limit:.3g})"
        for name, ratio, limit in zip(
            setup.channels, predictive_ratios(setup, comparison)[0], limits.ratios, strict=True
        )
        if not ratio <= limit
    ]
    predicted = float(estimator.predicted_errors(comparison)[0])
    if not predicted <= limits.predicted_error:
        found.append(
            "what the model at its answer leaves of the recording is as where sensors err or the actuator is "
            "not as described, and answers are wrong "
            f"(predicted error {predicted:.3g} of the allowed one, at most {limits.predicted_error:.3g})"
        )
    return Unlikeness(tuple(found), rare)


def limits_of(distances: Array, ratios: Array, predicted_errors: Array) -> Limits:
    """Return the limits from held-out `distances` (n, 2), `ratios` (n, channels), `predicted_errors` (n,)."""
    return Limits(
        LIKENESS.margin * np.quantile(distances, LIKENESS.quantile, axis=0),
        LIKENESS.margin * np.quantile(ratios, LIKENESS.quantile, axis=0),
        float(np.quantile(predicted_errors, LIKENESS.predicted_error_quantile)),
    )


def are_beyond(limits: Limits, distances: Array, ratios: Array, predicted_errors: Array) -> Array:
    """Return which of n draws are beyond a limit, (n,); arguments as for `limits_of`."""
    within = np.all(distances <= limits.distances, axis=1) & np.all(ratios <= limits.ratios, axis=1)
    return np.asarray(~(within & (predicted_errors <= limits.predicted_error)))
