"""From a setup to its estimator: simulate, train, calibrate, judge."""

import time
from collections.abc import Callable
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path

from emaphm.actuator import Command
from emaphm.amortized.drawing import PRIOR
from emaphm.amortized.estimator import Estimator
from emaphm.amortized.networks.torch_network import library
from emaphm.amortized.networks.training import TRAINING, Epoch, OnEpoch, TrainingSettings
from emaphm.amortized.recording_setup import RecordingSetup
from emaphm.amortized.simulating import SHARD_DRAWS, read_shards, simulate_shards, training_folder
from emaphm.amortized.stages.answering import Answering
from emaphm.amortized.stages.answering_networks import first_network, learned_update
from emaphm.amortized.stages.error_predictor import learned_error_predictor
from emaphm.amortized.stages.finishing import finished
from emaphm.errors import MethodError
from emaphm.execution import check_workers
from emaphm.simulation import AVERAGED
from emaphm.version import VERSION

HELD_OUT = 2
"""Shards that decide when training stops and how sure the answers are; as many again judge the result."""

PREDICTOR_DRAWS = 49_152
"""Draws that the error predictor learns from, at most."""


def train_estimator(
    setup: RecordingSetup,
    command: Command,
    folder: str | Path,
    *,
    simulations: int = 196_608,
    seed: int = 0,
    workers: int | None = None,
    scheduler: str | None = None,
    settings: TrainingSettings = TRAINING,
    on_shard: Callable[[int, int], None] | None = None,
    on_stage: Callable[[str], None] | None = None,
    on_epoch: OnEpoch | None = None,
) -> Estimator:
    """Return an estimator of `setup`, trained on simulations of the reference model.

    Parameters
    ----------
    setup
        The actuator, manoeuvre and channels: `RecordingSetup.of`.
    command
        Function of time [s] giving the user's position [rad; m if linear]: that of the setup.
    folder
        Where simulations are kept as they finish. A later call with the same folder and setup goes on. No
        other training uses it meanwhile.
    simulations
        How many to learn from, in whole shards of `SHARD_DRAWS`; four shards more are held out.
    seed, settings
        Source of all randomness; size and training of the first network.
    workers, scheduler
        Of the simulations, as for `emaphm.execution.outcomes`. Training itself is on this machine.
    on_shard, on_stage, on_epoch
        Called after each shard with how many are done, of how many; with what comes next, before each stage;
        and after each epoch.

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
    inputs = setup.inputs(command, AVERAGED.step_for(setup.actuator))
    shards = 2 * HELD_OUT + count
    say = on_stage or (lambda _: None)
    with place.locked():
        place.clear()
        say(f"{shards * SHARD_DRAWS:,} recordings are simulated, less those that {folder} has already")
        began = time.perf_counter()
        simulate_shards(
            setup,
            command,
            shards,
            place,
            seed=seed,
            workers=workers,
            scheduler=scheduler,
            on_shard=on_shard,
        )
        simulating = time.perf_counter() - began

        # The first are held out: with more simulations they stay the same.
        ends = (0, HELD_OUT, 2 * HELD_OUT, shards)
        validation, judging, training = (
            read_shards(place, range(first, stop)) for first, stop in pairwise(ends)
        )
        say(f"the first network learns from {len(training):,} simulations")
        trained = first_network(setup, training, validation, seed, settings, on_epoch)
        say(_kept("first", trained.kept))
        say("the averaged model is compared with them, and the second network learns from that")
        update, kept, second = learned_update(setup, inputs, trained, training, validation, seed, on_epoch)
        say(_kept("second", kept))
        answering = Answering.of(setup, inputs, trained, update, validation, seed)
        say("training the error predictor on simulations with deviations")
        predictor, third = learned_error_predictor(answering, training[:PREDICTOR_DRAWS], validation, seed)
        facts = {
            "version": VERSION,
            "simulations": len(training),
            "simulation_seconds": round(simulating, 1),
            "training_seconds": round(trained.seconds + second + third, 1),
            "epochs": len(trained.epochs),
            "notes": [*trained.notes, *notes_on_second_network(trained.kept, kept)],
            "seed": seed,
            "settings": asdict(settings),
            "prior": asdict(PRIOR),
        }
        return finished(answering, predictor, validation, judging, seed, facts)


def _kept(which: str, epoch: Epoch) -> str:
    """Return which state of a network is kept: the last one's error, where it is smaller, is not its."""
    return (
        f"the {which} network is kept as after epoch {epoch.number}, of the least loss: validation error "
        f"{epoch.validation_error:.2f} %"
    )


def notes_on_second_network(first: Epoch, second: Epoch) -> list[str]:
    """Return a note where the second network errs more than the first, of the kept states."""
    if second.validation_error <= first.validation_error:
        return []
    errors = f"{second.validation_error:.3g} %, the first alone by {first.validation_error:.3g} %"
    return [f"the second network errs by {errors} (median); give more --simulations"]
