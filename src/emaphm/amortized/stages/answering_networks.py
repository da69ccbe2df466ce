"""Training of the two answering networks: one reads rows, one their comparison with the averaged model."""

import time

import numpy as np

from emaphm.amortized.estimator import first_answers
from emaphm.amortized.model_update import UPDATE, ModelUpdate, UpdateStep, Whitening
from emaphm.amortized.networks.training import (
    UPDATE_TRAINING,
    Epoch,
    OnEpoch,
    Trained,
    TrainingSettings,
    median_error,
    train_network,
    with_noise,
)
from emaphm.amortized.parts import of_parts
from emaphm.amortized.recording_setup import RecordingSetup
from emaphm.amortized.simulating import SHARD_DRAWS, TrainingSet, noise_rms
from emaphm.arrays import Single
from emaphm.random_streams import stream
from emaphm.simulation import Inputs

LARGEST_ERROR = 60.0
"""Error of a step, in its own standard deviations, to which the second network's targets are limited: a step
with a larger error is altogether wrong."""

LEAST_DIFFERENCE = 1e-3
"""Smallest significant difference of a feature."""


def first_network(
    setup: RecordingSetup,
    training: TrainingSet,
    validation: TrainingSet,
    seed: int,
    settings: TrainingSettings,
    on_epoch: OnEpoch | None,
) -> Trained:
    """Return the trained first network, which reads rows alone."""
    space = setup.space
    return train_network(
        training,
        validation,
        noise_rms(setup),
        space.prior_deviations,
        lambda means: median_error(means, validation.points.astype(float), len(space.columns)),
        seed=seed,
        settings=settings,
        on_epoch=on_epoch,
    )


def learned_update(
    setup: RecordingSetup,
    inputs: Inputs,
    first: Trained,
    training: TrainingSet,
    validation: TrainingSet,
    seed: int,
    on_epoch: OnEpoch | None,
) -> tuple[ModelUpdate, Epoch, float]:
    """Return the update, trained on the draws of the `first` network with other noise.

    Second and third: the epoch whose state was kept, and the time of the training [s].
    """
    began = time.perf_counter()
    rng = stream(seed, "noise of the update")
    rows = with_noise(training[: UPDATE.directions], noise_rms(setup), rng)
    answers = first_answers(first.network, rows)
    compared = training[: UPDATE.differing]
    whitening = Whitening.of(setup, inputs, compared, rows, answers, first.network.projection.units)

    def steps(draws: TrainingSet, name: str) -> UpdateStep:
        """Return the steps for draws with noise, in parts: the rows of all would not fit into memory."""

        def of_part(part: slice, number: int) -> UpdateStep:
            rows = with_noise(draws[part], noise_rms(setup), stream(seed, name, number))
            return UpdateStep.of(setup, inputs, whitening, rows, first_answers(first.network, rows))

        return UpdateStep.joined(list(of_parts(of_part, len(draws), SHARD_DRAWS)))

    step = steps(training, "training noise of the update")
    held_out = steps(validation, "validation noise of the update")
    faults = len(setup.space.columns)
    trained = train_network(
        _in_units(step, training.points),
        _in_units(held_out, validation.points),
        np.full(1, LEAST_DIFFERENCE, np.float32),
        np.ones(setup.space.dimensions),
        lambda means: median_error(held_out.points_of(means), validation.points.astype(float), faults),
        seed=seed,
        settings=UPDATE_TRAINING,
        on_epoch=on_epoch,
    )
    update = ModelUpdate(whitening, trained.network)
    return update, trained.kept, time.perf_counter() - began


def _in_units(step: UpdateStep, points: Single) -> TrainingSet:
    """Return the second network's training set: the steps' features as one channel, and their errors."""
    errors = np.clip(step.units_of(points.astype(float)), -LARGEST_ERROR, LARGEST_ERROR)
    return TrainingSet(errors.astype(np.float32), step.features[:, np.newaxis])
