"""When an estimator is not to be believed: recordings unlike those that it was trained on.

Three distances of a recording from the training set are compared with those of held-out simulations. Two are
of the recording alone (`Projection.distances`). The third is of the answer: sixteen points of it are run by
the averaged model, at the price of one, and the recording has to lie among them,

    ratio = rms(recorded - mean) / √(variance of the runs + noise² + (model error)²),

for each channel. A network answers whatever it is asked; only such a comparison with physics shows an answer
that is sure and wrong.
"""

from dataclasses import dataclass

import numpy as np

from emaphm.amortized.estimator import Estimator, Limits
from emaphm.amortized.networks.mixture import Mixture
from emaphm.amortized.networks.network import Single
from emaphm.amortized.recording_setup import RecordingSetup
from emaphm.amortized.simulating import noise_rms, simulated
from emaphm.arrays import Array
from emaphm.estimation.problem import Problem
from emaphm.recording import Recording
from emaphm.simulation import AVERAGED, Inputs


@dataclass(frozen=True)
class LikenessSettings:
    """How a recording is compared with the training set.

    `runs` of the averaged model, as many as its kernel advances together; its error `model`, relative to a
    channel's rms; and limits: the `quantile` of held-out draws, times `margin`. Beyond are draws with heavy
    shorts, mostly: a full search for one of them costs less than a wrong answer.
    """

    runs: int = 16
    model: float = 0.02
    quantile: float = 0.99
    margin: float = 1.1


LIKENESS = LikenessSettings()


def predictive_ratios(
    setup: RecordingSetup, inputs: Inputs, mixture: Mixture, rows: Single, rng: np.random.Generator
) -> Array:
    """Return the ratio at the top of this file, of each channel of a recording's rows (channels, blocks)."""
    space = setup.space
    points = np.vstack([mixture.mean, mixture.inside(space, LIKENESS.runs - 1, rng)])
    runs = simulated(setup, inputs, AVERAGED, space.project(points))
    residual = np.mean((rows - runs[0]) ** 2, axis=-1)
    variance = np.mean((runs[1:] - runs[0]) ** 2, axis=(0, 2))
    expected = variance + noise_rms(setup) ** 2 + LIKENESS.model**2 * np.mean(rows**2, axis=-1)
    return np.asarray(np.sqrt(residual / np.maximum(expected, np.finfo(np.float32).tiny)), float)


def reasons_not_to_believe(
    estimator: Estimator, recording: Recording, mixture: Mixture, problem: Problem, rng: np.random.Generator
) -> tuple[str, ...]:
    """Return why the answer `mixture` for a `recording` is not to be believed, a clause each.

    `problem` is that of reproducing it by the averaged model.
    """
    if not estimator.setup.starts_there(problem.start):
        return ("it starts elsewhere than the training's manoeuvre, which starts at rest at 0",)
    rows = estimator.rows(recording)
    distances, limits = estimator.distances(rows)[0], estimator.limits
    what = ("farther from the middle of the training set", "of another shape than the training set")
    found = [
        f"the recording is {text} than simulations are ({distance:.3g}, at most {limit:.3g})"
        for text, distance, limit in zip(what, distances, limits.distances, strict=True)
        if not distance <= limit
    ]
    ratios = predictive_ratios(estimator.setup, problem.inputs, mixture, rows[0], rng)
    found += [
        f"the model at its answer is farther from {name} than the answer's own uncertainty allows "
        f"({ratio:.3g} times, at most {limit:.3g})"
        for name, ratio, limit in zip(estimator.setup.channels, ratios, limits.ratios, strict=True)
        if not ratio <= limit
    ]
    return tuple(found)


def limits_of(distances: Array, ratios: Array) -> Limits:
    """Return the limits from held-out `distances` (n, 2) and `ratios` (n, channels)."""
    return Limits(
        LIKENESS.margin * np.quantile(distances, LIKENESS.quantile, axis=0),
        LIKENESS.margin * np.quantile(ratios, LIKENESS.quantile, axis=0),
    )
