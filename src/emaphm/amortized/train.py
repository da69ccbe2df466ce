"""From a setup to its estimator: simulate, train, calibrate, judge."""

import time
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from emaphm.actuator import Command
from emaphm.amortized.drawing import PRIOR
from emaphm.amortized.estimator import Estimator, Limits, first_answers
from emaphm.amortized.judging import Judgement, judged, temperature_of
from emaphm.amortized.likeness import limits_of, predictive_ratios
from emaphm.amortized.model_update import ModelUpdate, Step, Whitening
from emaphm.amortized.networks.network import Single
from emaphm.amortized.networks.torch_network import library
from emaphm.amortized.recording_setup import RecordingSetup
from emaphm.amortized.simulating import (
    SHARD_DRAWS,
    TrainingSet,
    noise_rms,
    read_shards,
    simulate_shards,
    training_folder,
)
from emaphm.amortized.training import (
    TRAINING,
    UPDATE_TRAINING,
    OnEpoch,
    Trained,
    TrainingSettings,
    median_error,
    train_network,
    with_noise,
)
from emaphm.arrays import Array
from emaphm.errors import MethodError
from emaphm.execution import check_workers
from emaphm.random_streams import stream
from emaphm.simulation import AVERAGED, Inputs
from emaphm.version import VERSION

HELD_OUT = 2
"""Shards that decide when training stops and how sure the answers are; as many again judge the result."""

FARTHEST = 60.0
"""Largest error of a step in its own standard deviations that the second network is shown: a step that is
farther off is wrong altogether."""

LEAST_DIFFERENCE = 1e-3
"""Smallest difference of a feature that means anything."""

CHECKED = 1024
"""Held-out draws that the limits of the comparison with the averaged model are taken from."""


def train_estimator(
    setup: RecordingSetup,
    command: Command,
    folder: str | Path,
    *,
    simulations: int = 65_536,
    seed: int = 0,
    workers: int | None = None,
    scheduler: str | None = None,
    settings: TrainingSettings = TRAINING,
    on_shard: Callable[[int, int], None] | None = None,
    on_epoch: OnEpoch | None = None,
) -> Estimator:
    """Return an estimator of `setup`, trained on simulations of the reference model.

    Parameters
    ----------
    command
        Function of time [s] giving the user's position [rad]: that of the setup.
    folder
        Where simulations are kept as they finish. A later call with the same folder and setup goes on.
    simulations
        How many the first network learns from, in whole shards of `SHARD_DRAWS`. The update learns from three
        quarters as many more, and four shards are held out.
    workers, scheduler
        Of the simulations, as for `emaphm.execution.outcomes`. Training itself is on this machine.
    on_shard, on_epoch
        Called after each shard with how many are done, of how many; and after each epoch.

    Raises
    ------
    MethodError
        PyTorch is not installed, there are too few simulations, or training diverged.
    ExecutionError, OutputError
        The workers or the folder cannot be used, or the folder holds another training set.
    """
    library()
    if simulations < SHARD_DRAWS:
        raise MethodError(f"{simulations} simulations are too few to learn from; give {SHARD_DRAWS} or more")
    check_workers(scheduler)
    place = training_folder(Path(folder), setup, seed)
    count = -(-simulations // SHARD_DRAWS)
    further = -(-3 * count // 4)
    with place.locked():
        place.clear()
        began = time.perf_counter()
        simulate_shards(
            setup,
            command,
            2 * HELD_OUT + count + further,
            place,
            seed=seed,
            workers=workers,
            scheduler=scheduler,
            on_shard=on_shard,
        )
        simulating = time.perf_counter() - began
        # The first are held out: with more simulations they stay the same.
        validation = read_shards(place, range(HELD_OUT))
        judging = read_shards(place, range(HELD_OUT, 2 * HELD_OUT))
        first = 2 * HELD_OUT + count
        training = read_shards(place, range(2 * HELD_OUT, first))
        unseen = read_shards(place, range(first, first + further))
    inputs = setup.inputs(command, AVERAGED.step_for(setup.actuator))
    trained = _first_network(setup, training, validation, seed, settings, on_epoch)
    update, second = _model_update(setup, inputs, trained, training, unseen, validation, seed, on_epoch)
    space = setup.space
    nothing = Limits(np.full(2, np.inf), np.full(len(setup.channels), np.inf))
    bare = Estimator(setup, trained.projection, trained.network, update, np.ones(space.dimensions), nothing)
    facts = {
        "version": VERSION,
        "simulations": len(training),
        "update_simulations": len(unseen),
        "simulation_seconds": round(simulating, 1),
        "training_seconds": round(trained.seconds + second, 1),
        "epochs": len(trained.epochs),
        "notes": list(trained.notes),
        "seed": seed,
        "settings": asdict(settings),
        "prior": asdict(PRIOR),
    }
    return _calibrated(bare, inputs, validation, judging, seed, facts)


def _first_network(
    setup: RecordingSetup,
    training: TrainingSet,
    validation: TrainingSet,
    seed: int,
    settings: TrainingSettings,
    on_epoch: OnEpoch | None,
) -> Trained:
    """Return the network that reads rows alone."""
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


def _model_update(
    setup: RecordingSetup,
    inputs: Inputs,
    first: Trained,
    training: TrainingSet,
    unseen: TrainingSet,
    validation: TrainingSet,
    seed: int,
    on_epoch: OnEpoch | None,
) -> tuple[ModelUpdate, float]:
    """Return the update, learned from draws that the `first` network has not seen, and its time [s]."""
    began = time.perf_counter()
    rows = with_noise(unseen, noise_rms(setup), stream(seed, "noise of the update"))
    answers = first_answers(first.network, rows)
    whitening = Whitening.of(setup, inputs, training, rows, answers, first.projection.units)
    step = Step.of(setup, inputs, whitening, rows, answers)
    rows = with_noise(validation, noise_rms(setup), stream(seed, "validation noise of the update"))
    held_out = Step.of(setup, inputs, whitening, rows, first_answers(first.network, rows))
    faults = len(setup.space.columns)
    trained = train_network(
        _in_units(step, unseen.points),
        _in_units(held_out, validation.points),
        np.full(1, LEAST_DIFFERENCE, np.float32),
        np.ones(setup.space.dimensions),
        lambda means: median_error(held_out.points_of(means), validation.points.astype(float), faults),
        seed=seed,
        settings=UPDATE_TRAINING,
        on_epoch=on_epoch,
    )
    return ModelUpdate(whitening, trained.projection, trained.network), time.perf_counter() - began


def _in_units(step: Step, points: Single) -> TrainingSet:
    """Return what the second network learns: a step's features as one channel, and what the step misses."""
    missed = np.clip(step.units_of(points.astype(float)), -FARTHEST, FARTHEST)
    return TrainingSet(missed.astype(np.float32), step.features[:, np.newaxis])


def _calibrated(
    bare: Estimator,
    inputs: Inputs,
    validation: TrainingSet,
    judging: TrainingSet,
    seed: int,
    facts: dict[str, Any],
) -> Estimator:
    """Return the estimator with its temperature and limits, and how it was judged among its facts."""
    setup, space = bare.setup, bare.space
    rows = with_noise(validation, noise_rms(setup), stream(seed, "noise of the calibration"))
    temperature = temperature_of(bare.answers(rows, inputs), validation.points.astype(float))
    warm = replace(bare, temperature=temperature)
    limits = limits_of(warm.distances(rows), _ratios(warm, inputs, rows[:CHECKED], seed))
    judging_rows = with_noise(judging, noise_rms(setup), stream(seed, "noise of the judgement"))
    rng = stream(seed, "samples of the judgement")
    judgement = judged(warm.answers(judging_rows, inputs), judging.points.astype(float), space, rng)
    facts = {**facts, "judgement": _judgement_dict(judgement, space.coordinates)}
    return replace(warm, limits=limits, facts=facts)


def _ratios(estimator: Estimator, inputs: Inputs, rows: Single, seed: int) -> Array:
    rng = stream(seed, "likeness")
    return np.array(
        [
            predictive_ratios(estimator.setup, inputs, answer, one, rng)
            for answer, one in zip(estimator.answers(rows, inputs), rows, strict=True)
        ]
    )


def _judgement_dict(judgement: Judgement, coordinates: tuple[str, ...]) -> dict[str, Any]:
    return {
        "draws": judgement.draws,
        "median_error_percent": judgement.median,
        "p95_error_percent": judgement.p95,
        "coverage95": dict(zip(coordinates, judgement.coverage.tolist(), strict=True)),
        "rank_chi2": dict(zip(coordinates, judgement.rank_statistic.tolist(), strict=True)),
        "rank_chi2_limit": judgement.rank_limit,
        "ranks": dict(zip(coordinates, judgement.ranks.tolist(), strict=True)),
    }
