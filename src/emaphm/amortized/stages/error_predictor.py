"""Training of the error predictor, on simulated recordings with deviations from the description."""

import time

import numpy as np

from emaphm.amortized.error_prediction.deviations import deviating
from emaphm.amortized.error_prediction.predictor import ErrorPredictor, error_ratios
from emaphm.amortized.networks.training import PREDICTOR_TRAINING, train_network, with_noise
from emaphm.amortized.parts import of_parts
from emaphm.amortized.simulating import SHARD_DRAWS, TrainingSet, noise_rms
from emaphm.amortized.stages.answering import Answering
from emaphm.amortized.stages.answering_networks import LEAST_DIFFERENCE
from emaphm.arrays import Array, Single
from emaphm.random_streams import stream


def learned_error_predictor(
    answering: Answering, training: TrainingSet, validation: TrainingSet, seed: int
) -> tuple[ErrorPredictor, float]:
    """Return the error predictor, trained on draws with deviations, and the time of its training [s]."""
    began = time.perf_counter()
    setup = answering.setup
    faults = len(setup.space.columns)

    def training_set(draws: TrainingSet, name: str) -> TrainingSet:
        """Return the features as one channel, and the logarithms of the error ratios as points."""

        def of_part(part: slice, number: int) -> tuple[Single, Array]:
            rng = stream(seed, name, number)
            some_draws = deviating(setup, answering.inputs, draws[part], rng)
            rows = with_noise(some_draws, noise_rms(setup), rng)
            answers = answering.answers(rows)
            means = np.array([answer.mean for answer in answers])
            variances = np.array([np.diag(answer.covariance) for answer in answers])
            ratios = error_ratios(means, variances, some_draws.points.astype(float), faults)
            return answering.compared(rows, answers, rng)[0], ratios

        features, ratios = zip(*of_parts(of_part, len(draws), SHARD_DRAWS), strict=True)
        points = np.log(np.concatenate(ratios))[:, np.newaxis].astype(np.float32)
        return TrainingSet(points, np.concatenate(features)[:, np.newaxis])

    held_out = training_set(validation, "deviations of the validation")
    trained = train_network(
        training_set(training, "deviations"),
        held_out,
        np.full(1, LEAST_DIFFERENCE, np.float32),
        np.ones(1),
        lambda means: 100 * float(np.median(np.abs(means - held_out.points))),
        seed=seed,
        settings=PREDICTOR_TRAINING,
    )
    return ErrorPredictor(trained.network), time.perf_counter() - began
