"""From a setup to its estimator: simulate, train, calibrate, judge."""

import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from emaphm.actuator import Command
from emaphm.amortized.drawing import PRIOR
from emaphm.amortized.estimator import Estimator, Limits
from emaphm.amortized.judging import Judgement, judged, temperature_of
from emaphm.amortized.likeness import limits_of, predictive_ratios
from emaphm.amortized.network import Single
from emaphm.amortized.recording_setup import RecordingSetup
from emaphm.amortized.simulating import (
    SHARD_DRAWS,
    TrainingSet,
    noise_rms,
    read_shards,
    simulate_shards,
    training_folder,
)
from emaphm.amortized.torch_network import library
from emaphm.amortized.training import TRAINING, OnEpoch, Trained, TrainingSettings, train_network
from emaphm.arrays import Array
from emaphm.errors import MethodError
from emaphm.execution import check_workers
from emaphm.random_streams import stream
from emaphm.simulation import AVERAGED
from emaphm.version import VERSION

HELD_OUT = 2
"""Shards that decide when training stops and how sure the answers are; as many again judge the result."""

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
        How many to learn from, in whole shards of `SHARD_DRAWS`; four shards more are held out.
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
    with place.locked():
        place.clear()
        began = time.perf_counter()
        simulate_shards(
            setup,
            command,
            count + 2 * HELD_OUT,
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
        training = read_shards(place, range(2 * HELD_OUT, 2 * HELD_OUT + count))
    space = setup.space
    trained = train_network(
        training,
        validation,
        noise_rms(setup),
        space.prior_deviations,
        len(space.columns),
        seed=seed,
        settings=settings,
        on_epoch=on_epoch,
    )
    return _calibrated(
        setup, command, trained, validation, judging, simulating, seed, settings, len(training)
    )


def _calibrated(
    setup: RecordingSetup,
    command: Command,
    trained: Trained,
    validation: TrainingSet,
    judging: TrainingSet,
    simulating: float,
    seed: int,
    settings: TrainingSettings,
    simulations: int,
) -> Estimator:
    """Return the estimator of a trained network: its temperature, its limits, and how it was judged."""
    nothing = Limits(np.full(2, np.inf), np.full(len(setup.channels), np.inf))
    one = np.ones(trained.network.dimensions)
    bare = Estimator(setup, trained.projection, trained.network, one, nothing)
    rows = _noisy(setup, validation, stream(seed, "noise of the calibration"))
    temperature = temperature_of(bare.answers(rows), validation.points.astype(float))
    warm = Estimator(setup, trained.projection, trained.network, temperature, nothing)
    limits = limits_of(warm.distances(rows), _ratios(warm, command, rows[:CHECKED], seed))
    judging_rows = _noisy(setup, judging, stream(seed, "noise of the judgement"))
    rng = stream(seed, "samples of the judgement")
    judgement = judged(warm.answers(judging_rows), judging.points.astype(float), warm.space, rng)
    facts = {
        "version": VERSION,
        "simulations": simulations,
        "simulation_seconds": round(simulating, 1),
        "training_seconds": round(trained.seconds, 1),
        "epochs": len(trained.epochs),
        "notes": list(trained.notes),
        "seed": seed,
        "settings": asdict(settings),
        "prior": asdict(PRIOR),
        "judgement": _judgement_dict(judgement, warm.space.coordinates),
    }
    return Estimator(setup, trained.projection, trained.network, temperature, limits, facts)


def _noisy(setup: RecordingSetup, held_out: TrainingSet, rng: np.random.Generator) -> Single:
    normal = rng.standard_normal(held_out.rows.shape, dtype=np.float32)
    return np.asarray(held_out.rows + noise_rms(setup)[:, np.newaxis] * normal)


def _ratios(estimator: Estimator, command: Command, rows: Single, seed: int) -> Array:
    inputs = estimator.setup.inputs(command, AVERAGED.step_for(estimator.setup.actuator))
    rng = stream(seed, "likeness")
    answers = estimator.answers(rows)
    return np.array(
        [
            predictive_ratios(estimator.setup, inputs, answer, one, rng)
            for answer, one in zip(answers, rows, strict=True)
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
