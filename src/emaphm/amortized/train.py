"""Training of an estimator from its setup: simulation, networks, calibration, and assessment."""

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
"""Shards of the validation set, which decides the end of training and the temperature. As many shards again
assess the estimator."""

PREDICTOR_DRAWS = 49_152
"""Largest number of draws that the error predictor learns from."""


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
        Function of time [s] giving the user's position [rad; m if linear]: the command of the setup.
    folder
        Folder in which simulations are stored as they finish. A later call with the same folder and setup
        continues them. The folder is locked against other trainings meanwhile.
    simulations
        Number of simulations to learn from, rounded up to shards of `SHARD_DRAWS`; four more shards are held
        out.
    seed, settings
        Source of all randomness; size and training of the first network.
    workers, scheduler
        For the simulations, as in `emaphm.execution.outcomes`. The networks are trained on this machine.
    on_shard, on_stage, on_epoch
        Called after each shard with the number of finished shards and of all shards; before each stage with a
        sentence on it; and after each epoch.

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
    report = on_stage or (lambda _: None)
    with place.locked():
        place.clear()
        report(f"{shards * SHARD_DRAWS:,} recordings are simulated, except those already in {folder}")
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
        simulation_s = time.perf_counter() - began

        # The first shards are held out: they stay the same with more simulations.
        ends = (0, HELD_OUT, 2 * HELD_OUT, shards)
        validation, judging, training = (
            read_shards(place, range(first, stop)) for first, stop in pairwise(ends)
        )
        report(f"training the first network on {len(training):,} simulations")
        trained = first_network(setup, training, validation, seed, settings, on_epoch)
        report(_kept_state("first", trained.kept))
        report("training the second network on comparisons of the averaged model with the simulations")
        update, kept, second_s = learned_update(setup, inputs, trained, training, validation, seed, on_epoch)
        report(_kept_state("second", kept))
        answering = Answering.of(setup, inputs, trained, update, validation, seed)
        report("training the error predictor on simulations with deviations")
        predictor, third_s = learned_error_predictor(answering, training[:PREDICTOR_DRAWS], validation, seed)
        facts = {
            "version": VERSION,
            "simulations": len(training),
            "simulation_seconds": round(simulation_s, 1),
            "training_seconds": round(trained.seconds + second_s + third_s, 1),
            "epochs": len(trained.epochs),
            "notes": [*trained.notes, *notes_on_second_network(trained.kept, kept)],
            "seed": seed,
            "settings": asdict(settings),
            "prior": asdict(PRIOR),
        }
        return finished(answering, predictor, validation, judging, seed, facts)


def _kept_state(network: str, epoch: Epoch) -> str:
    """Return the sentence on which state of a network is kept; a later state may have a smaller error."""
    return (
        f"the {network} network is kept as after epoch {epoch.number}, which has the least validation loss: "
        f"validation error {epoch.validation_error:.2f} %"
    )


def notes_on_second_network(first: Epoch, second: Epoch) -> list[str]:
    """Return a note if the kept second network has a larger error than the kept first one."""
    if second.validation_error <= first.validation_error:
        return []
    both, alone = second.validation_error, first.validation_error
    errors = f"{both:.3g} % with the second network, {alone:.3g} % with the first alone"
    return [f"the median error is {errors}; give more --simulations"]
