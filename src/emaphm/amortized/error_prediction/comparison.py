"""Runs of the averaged model at an answer, and what they leave of the recording.

What is left is whitened as in `emaphm.amortized.model_update`, and what the answer's own uncertainty could
take up is taken out of it. Then it is compared with the directions of what no simulation has (a score test,
Rao 1948): with the signal's derivative for a sensor that comes late, with the signal itself for another
scale, and so on. The size of a score depends on the answer too: where all phases are shorted, the averaged
model is off anyway. So no limit of a single score would do, and a small network weighs them
(`emaphm.amortized.error_prediction.predictor`).
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
"""Runs at an answer: its mean, and draws; as many as the model's kernel advances together."""

RIDGE = 1e-6
"""Added to the normal matrix of the runs, relative to its mean diagonal: runs may be alike."""

SMALL_RESIDUAL, SMALL_LENGTH, SMALL_DISTANCE = 0.3, 1e-3, 0.1
"""Added to a residual and to a direction's length, in standard deviations, and least of a distance, before
logarithms are taken: what is smaller says nothing."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """What was run at n answers, `rows` (n, channels, blocks) being those recorded.

    `runs` (n, 16, channels, blocks) are those at the answer, its mean first; `others` (n, 2, channels,
    blocks) those of `other_descriptions` at the mean.
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
        points = np.array([np.vstack([one.mean, one.inside(space, RUNS - 1, rng)]) for one in answers])
        flat = space.project(points.reshape(-1, space.dimensions))
        runs = simulated(setup, inputs, AVERAGED, flat).reshape(len(rows), RUNS, *rows.shape[1:])
        return cls(answers, rows, runs, other_descriptions(setup, inputs, flat[::RUNS]))

    def __getitem__(self, part: slice) -> "Comparison":
        """Return the comparison of some of the answers."""
        return Comparison(self.answers[part], self.rows[part], self.runs[part], self.others[part])

    def features(self, setup: RecordingSetup, whitening: Whitening, distances: Array) -> Single:
        """Return what the error predictor reads, (n, `predictor_feature_count`).

        `distances` (n, 2) from the training set are as in `Projection.distances`.
        """
        left = self._left(whitening)
        of_recording, along = left[:, 0], left[:, 1:]
        lengths = np.linalg.norm(along, axis=2) + SMALL_LENGTH
        scores = np.einsum("nmk,nk->nm", along, of_recording) / lengths
        sizes = [np.sqrt(np.mean(of_recording**2, axis=1)), np.median(np.abs(of_recording), axis=1)]
        variances = np.array([np.diag(one.covariance) for one in self.answers])
        found = [
            np.arcsinh(scores),
            np.log(lengths),
            np.log(SMALL_RESIDUAL + np.stack(sizes, axis=1)),
            np.array([one.mean for one in self.answers]) / setup.space.prior_deviations,
            np.log(variances) / 2,
            np.log(np.maximum(distances, SMALL_DISTANCE)),
        ]
        return np.concatenate(found, axis=1).astype(np.float32)

    def residuals(self, whitening: Whitening) -> tuple[Array, Array]:
        """Return the whitened residual at each answer (n, k), and the length of each direction (n, m).

        Both less what the answer's uncertainty takes up; directions are as in `deviation_directions`.
        """
        left = self._left(whitening)
        return left[:, 0], np.linalg.norm(left[:, 1:], axis=2)

    def _left(self, whitening: Whitening) -> Array:
        """Return the whitened residual and directions (n, 1 + m, k), less what the draws' runs take up."""
        directions = deviation_directions(self.runs[:, 0], self.others)
        every = np.concatenate([self.rows[:, np.newaxis], self.runs, directions], axis=1)
        n, count = every.shape[:2]
        seen = whitening.whitened(every.reshape(n * count, *every.shape[2:])).astype(float)
        seen = seen.reshape(n, count, -1)
        residual = seen[:, :1] - seen[:, 1:2] - whitening.whitened_mean
        moved = seen[:, 2 : 1 + RUNS] - seen[:, 1:2]
        both = np.concatenate([residual, seen[:, 1 + RUNS :]], axis=1)
        normal = moved @ moved.transpose(0, 2, 1)
        size = np.trace(normal, axis1=1, axis2=2)[:, np.newaxis, np.newaxis] / moved.shape[1]
        normal += (RIDGE * size + np.finfo(float).tiny) * np.eye(moved.shape[1])
        taken_up = np.linalg.solve(normal, moved @ both.transpose(0, 2, 1))
        return np.asarray(both - taken_up.transpose(0, 2, 1) @ moved)


def predictor_feature_count(channels: int, dimensions: int) -> int:
    """Return how many numbers the error predictor reads."""
    return 2 * deviation_count(channels) + 2 + 2 * dimensions + 2
