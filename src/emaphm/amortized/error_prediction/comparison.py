"""Runs of the averaged model at an answer, their residuals, and scores of deviations.

The residual of the recording is whitened as in `emaphm.amortized.model_update`, and projected on the
complement of the directions that the answer's own uncertainty spans. The scores of deviations which no
simulation has are its components along their directions (a score test, Rao 1948): the signal's derivative for
a delayed sensor, the signal itself for another scale, and so on. The size of a score depends on the answer
too: the averaged model deviates where all phases are shorted. A limit of each single score is therefore not
sufficient, and a small network evaluates all scores together (`emaphm.amortized.error_prediction.predictor`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from emaphm.amortized.error_prediction.deviations import (
    deviation_count,
    deviation_directions,
    other_descriptions,
)
from emaphm.amortized.model_update import Whitening
from emaphm.amortized.networks.mixture import Mixture
from emaphm.amortized.recording_setup import RecordingSetup
from emaphm.amortized.simulating import simulated
from emaphm.arrays import Array, Single
from emaphm.simulation import AVERAGED, Inputs

RUNS = 16
"""Runs at an answer: its mean, and draws; the model's kernel advances this number of runs together."""

RIDGE = 1e-6
"""Added to the normal matrix of the runs, relative to its mean diagonal, because runs may be nearly equal."""

SMALL_RESIDUAL, SMALL_LENGTH, SMALL_DISTANCE = 0.3, 1e-3, 0.1
"""Floors before logarithms are taken: added to a residual and to a direction's length, in standard
deviations; least value of a distance. Smaller values carry no information."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """Recordings, their answers, and runs of the averaged model at these.

    `rows` (n, channels, blocks) are the recordings. `runs` (n, 16, channels, blocks) are the runs at points
    of the answer, its mean first. `others` (n, 2, channels, blocks) are the runs of `other_descriptions` at
    the mean.
    """

    answers: Sequence[Mixture]
    rows: Single
    runs: Single
    others: Single

    @classmethod
    def of(
        cls,
        setup: RecordingSetup,
        inputs: Inputs,
        rows: Single,
        answers: Sequence[Mixture],
        rng: np.random.Generator,
    ) -> Self:
        """Return the comparison of recordings' rows (n, channels, blocks) with their answers."""
        space = setup.space
        points = np.array(
            [np.vstack([answer.mean, answer.inside(space, RUNS - 1, rng)]) for answer in answers]
        )
        flat = space.project(points.reshape(-1, space.dimensions))
        runs = simulated(setup, inputs, AVERAGED, flat).reshape(len(rows), RUNS, *rows.shape[1:])
        return cls(answers, rows, runs, other_descriptions(setup, inputs, flat[::RUNS]))

    def __getitem__(self, part: slice) -> "Comparison":
        """Return the comparison of the answers in the slice `part`."""
        return Comparison(self.answers[part], self.rows[part], self.runs[part], self.others[part])

    def features(self, setup: RecordingSetup, whitening: Whitening, distances: Array) -> Single:
        """Return the features that the error predictor reads, (n, `predictor_feature_count`).

        `distances` (n, 2) from the training set are those of `Projection.distances`.
        """
        projected = self._projected(whitening)
        residual, directions = projected[:, 0], projected[:, 1:]
        lengths = np.linalg.norm(directions, axis=2) + SMALL_LENGTH
        scores = np.einsum("nmk,nk->nm", directions, residual) / lengths
        sizes = [np.sqrt(np.mean(residual**2, axis=1)), np.median(np.abs(residual), axis=1)]
        variances = np.array([np.diag(answer.covariance) for answer in self.answers])
        features = [
            np.arcsinh(scores),
            np.log(lengths),
            np.log(SMALL_RESIDUAL + np.stack(sizes, axis=1)),
            np.array([answer.mean for answer in self.answers]) / setup.space.prior_deviations,
            np.log(variances) / 2,
            np.log(np.maximum(distances, SMALL_DISTANCE)),
        ]
        return np.concatenate(features, axis=1).astype(np.float32)

    def residuals(self, whitening: Whitening) -> tuple[Array, Array]:
        """Return the whitened residual at each answer (n, k), and the length of each direction (n, m).

        Both are projected on the complement of the answer's uncertainty. The directions are those of
        `deviation_directions`.
        """
        projected = self._projected(whitening)
        return projected[:, 0], np.linalg.norm(projected[:, 1:], axis=2)

    def _projected(self, whitening: Whitening) -> Array:
        """Return the whitened residual and directions (n, 1 + m, k), orthogonal to the draws' differences.

        The differences are those of the runs at draws of the answer from the run at its mean.
        """
        directions = deviation_directions(self.runs[:, 0], self.others)
        rows = np.concatenate([self.rows[:, np.newaxis], self.runs, directions], axis=1)
        n, count = rows.shape[:2]
        whitened = whitening.whitened(rows.reshape(n * count, *rows.shape[2:])).astype(float)
        whitened = whitened.reshape(n, count, -1)
        residual = whitened[:, :1] - whitened[:, 1:2] - whitening.whitened_mean
        differences = whitened[:, 2 : 1 + RUNS] - whitened[:, 1:2]
        vectors = np.concatenate([residual, whitened[:, 1 + RUNS :]], axis=1)
        normal = differences @ differences.transpose(0, 2, 1)
        size = np.trace(normal, axis1=1, axis2=2)[:, np.newaxis, np.newaxis] / differences.shape[1]
        normal += (RIDGE * size + np.finfo(float).tiny) * np.eye(differences.shape[1])
        coefficients = np.linalg.solve(normal, differences @ vectors.transpose(0, 2, 1))
        return np.asarray(vectors - coefficients.transpose(0, 2, 1) @ differences)


def predictor_feature_count(channels: int, dimensions: int) -> int:
    """Return the number of features that the error predictor reads."""
    return 2 * deviation_count(channels) + 2 + 2 * dimensions + 2
