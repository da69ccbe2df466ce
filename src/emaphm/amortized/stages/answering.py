"""The answering networks with their temperature, before the error predictor is trained."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from emaphm.amortized.applicability.likeness import predictive_ratios
from emaphm.amortized.error_prediction.comparison import Comparison
from emaphm.amortized.estimator import calibrated_answers
from emaphm.amortized.judging import temperature_of
from emaphm.amortized.model_update import UPDATE, ModelUpdate
from emaphm.amortized.networks.mixture import Mixture
from emaphm.amortized.networks.training import Trained, with_noise
from emaphm.amortized.recording_setup import RecordingSetup
from emaphm.amortized.simulating import TrainingSet, noise_rms
from emaphm.arrays import Array, Single
from emaphm.random_streams import stream
from emaphm.simulation import Inputs


@dataclass(frozen=True, eq=False)
class Answering:
    """An estimator without error predictor and limits; fields as those of `Estimator`."""

    setup: RecordingSetup
    inputs: Inputs
    first: Trained
    update: ModelUpdate
    temperature: Array

    @classmethod
    def of(
        cls,
        setup: RecordingSetup,
        inputs: Inputs,
        first: Trained,
        update: ModelUpdate,
        validation: TrainingSet,
        seed: int,
    ) -> Self:
        """Return the trained networks with the temperature from the draws of `validation`."""
        uncalibrated = cls(setup, inputs, first, update, np.ones(setup.space.dimensions))
        rows = with_noise(validation, noise_rms(setup), stream(seed, "noise of the calibration"))
        temperature = temperature_of(uncalibrated.answers(rows), validation.points.astype(float))
        return replace(uncalibrated, temperature=temperature)

    def answers(self, rows: Single) -> list[Mixture]:
        """Return the posteriors by both networks for rows (n, channels, blocks)."""
        return calibrated_answers(
            self.setup, self.first.network, self.update, self.temperature, rows, self.inputs
        )

    def distances(self, rows: Single) -> Array:
        """Return the distances T² and Q of rows (n, channels, blocks) from the training set, (n, 2)."""
        return self.first.network.distances(rows)

    def compared(
        self, rows: Single, answers: Sequence[Mixture], rng: np.random.Generator
    ) -> tuple[Single, Array]:
        """Return the error predictor's features (n, k) for answers, and their ratios (n, channels)."""
        features, ratios = [], []
        for i in range(0, len(rows), UPDATE.at_once):
            part = slice(i, i + UPDATE.at_once)
            comparison = Comparison.of(self.setup, self.inputs, rows[part], answers[part], rng)
            distances = self.distances(rows[part])
            features.append(comparison.features(self.setup, self.update.whitening, distances))
            ratios.append(predictive_ratios(self.setup, comparison))
        return np.concatenate(features), np.concatenate(ratios)
