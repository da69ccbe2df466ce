"""From a setup to its estimator: simulate, train, calibrate, judge."""

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Self

import numpy as np

from emaphm.actuator import Command
from emaphm.amortized.applicability.likeness import are_beyond, limits_of, predictive_ratios
from emaphm.amortized.drawing import PRIOR
from emaphm.amortized.error_prediction.comparison import Comparison
from emaphm.amortized.error_prediction.deviations import deviating
from emaphm.amortized.error_prediction.predictor import ErrorPredictor, error_ratios
from emaphm.amortized.estimator import Estimator, calibrated_answers, first_answers
from emaphm.amortized.judging import Judgement, judged, temperature_of
from emaphm.amortized.model_update import UPDATE, ModelUpdate, UpdateStep, Whitening
from emaphm.amortized.networks.mixture import Mixture
from emaphm.amortized.networks.network import Single
from emaphm.amortized.networks.torch_network import library
from emaphm.amortized.networks.training import (
    PREDICTOR_TRAINING,
    TRAINING,
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
from emaphm.amortized.simulating import (
    SHARD_DRAWS,
    TrainingSet,
    noise_rms,
    read_shards,
    simulate_shards,
    training_folder,
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

PREDICTOR_DRAWS = 49_152
"""Draws that the error predictor learns from, at most."""

LOOKED_AT_ONCE = 512
"""Held-out draws that one core looks at together."""


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
        trained = _first_network(setup, training, validation, seed, settings, on_epoch)
        say(_kept("first", trained.kept))
        say("the averaged model is compared with them, and the second network learns from that")
        update, kept, second = _model_update(setup, inputs, trained, training, validation, seed, on_epoch)
        say(_kept("second", kept))
        answering = _Answering.of(setup, inputs, trained, update, validation, seed)
        say("training the error predictor on simulations with deviations")
        predictor, third = _error_predictor(answering, training[:PREDICTOR_DRAWS], validation, seed)
        facts = {
            "version": VERSION,
            "simulations": len(training),
            "simulation_seconds": round(simulating, 1),
            "training_seconds": round(trained.seconds + second + third, 1),
            "epochs": len(trained.epochs),
            "notes": [*trained.notes, *_lost(trained.kept, kept)],
            "seed": seed,
            "settings": asdict(settings),
            "prior": asdict(PRIOR),
        }
        return _finished(answering, predictor, validation, judging, seed, facts)


def _kept(which: str, epoch: Epoch) -> str:
    """Return which state of a network is kept: the last one's error, where it is smaller, is not its."""
    return (
        f"the {which} network is kept as after epoch {epoch.number}, of the least loss: validation error "
        f"{epoch.validation_error:.2f} %"
    )


def _lost(first: Epoch, second: Epoch) -> list[str]:
    """Return a note where the second network errs more than the first, of the kept states."""
    if second.validation_error <= first.validation_error:
        return []
    errors = f"{second.validation_error:.3g} %, the first alone by {first.validation_error:.3g} %"
    return [f"the second network errs by {errors} (median); give more --simulations"]


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
    validation: TrainingSet,
    seed: int,
    on_epoch: OnEpoch | None,
) -> tuple[ModelUpdate, Epoch, float]:
    """Return the update, learned from the draws of the `first` network with other noise.

    Also the epoch whose state it is, and the time that all took [s].
    """
    began = time.perf_counter()
    rng = stream(seed, "noise of the update")
    rows = with_noise(training[: UPDATE.directions], noise_rms(setup), rng)
    answers = first_answers(first.network, rows)
    compared = training[: UPDATE.differing]
    whitening = Whitening.of(setup, inputs, compared, rows, answers, first.projection.units)

    def steps(draws: TrainingSet, name: str) -> UpdateStep:
        """Return the steps of draws with noise, a part at a time: that of all would not fit into memory."""

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
    update = ModelUpdate(whitening, trained.projection, trained.network)
    return update, trained.kept, time.perf_counter() - began


def _in_units(step: UpdateStep, points: Single) -> TrainingSet:
    """Return what the second network learns: a step's features as one channel, and what the step misses."""
    missed = np.clip(step.units_of(points.astype(float)), -FARTHEST, FARTHEST)
    return TrainingSet(missed.astype(np.float32), step.features[:, np.newaxis])


@dataclass(frozen=True, eq=False)
class _Answering:
    """What answers, before its error can be predicted; fields as those of `Estimator`."""

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
        """Return the trained networks with the temperature that `validation` asks for."""
        as_learned = cls(setup, inputs, first, update, np.ones(setup.space.dimensions))
        rows = with_noise(validation, noise_rms(setup), stream(seed, "noise of the calibration"))
        found = temperature_of(as_learned.answers(rows), validation.points.astype(float))
        return replace(as_learned, temperature=found)

    def answers(self, rows: Single) -> list[Mixture]:
        return calibrated_answers(
            self.setup, self.first.network, self.update, self.temperature, rows, self.inputs
        )

    def distances(self, rows: Single) -> Array:
        return self.first.projection.distances(rows, self.first.network.features(rows))

    def compared(
        self, rows: Single, answers: Sequence[Mixture], rng: np.random.Generator
    ) -> tuple[Single, Array]:
        """Return what the error predictor reads of answers (n, k), and their ratios (n, channels)."""
        features, ratios = [], []
        for i in range(0, len(rows), UPDATE.at_once):
            part = slice(i, i + UPDATE.at_once)
            one = Comparison.of(self.setup, self.inputs, rows[part], answers[part], rng)
            features.append(one.features(self.setup, self.update.whitening, self.distances(rows[part])))
            ratios.append(predictive_ratios(self.setup, one))
        return np.concatenate(features), np.concatenate(ratios)


def _error_predictor(
    answering: _Answering, training: TrainingSet, validation: TrainingSet, seed: int
) -> tuple[ErrorPredictor, float]:
    """Return the error predictor, learned from draws that deviate, and its time [s]."""
    began = time.perf_counter()
    setup = answering.setup
    faults = len(setup.space.columns)

    def learned_from(draws: TrainingSet, name: str) -> TrainingSet:
        """Return the features as one channel, and the logarithms of the ratios as points."""

        def of_part(part: slice, number: int) -> tuple[Single, Array]:
            rng = stream(seed, name, number)
            some = deviating(setup, answering.inputs, draws[part], rng)
            rows = with_noise(some, noise_rms(setup), rng)
            answers = answering.answers(rows)
            means = np.array([one.mean for one in answers])
            variances = np.array([np.diag(one.covariance) for one in answers])
            ratios = error_ratios(means, variances, some.points.astype(float), faults)
            return answering.compared(rows, answers, rng)[0], ratios

        features, ratios = zip(*of_parts(of_part, len(draws), SHARD_DRAWS), strict=True)
        points = np.log(np.concatenate(ratios))[:, np.newaxis].astype(np.float32)
        return TrainingSet(points, np.concatenate(features)[:, np.newaxis])

    held_out = learned_from(validation, "deviations of the validation")
    trained = train_network(
        learned_from(training, "deviations"),
        held_out,
        np.full(1, LEAST_DIFFERENCE, np.float32),
        np.ones(1),
        lambda means: 100 * float(np.median(np.abs(means - held_out.points))),
        seed=seed,
        settings=PREDICTOR_TRAINING,
    )
    return ErrorPredictor(trained.projection, trained.network), time.perf_counter() - began


def _finished(
    answering: _Answering,
    predictor: ErrorPredictor,
    validation: TrainingSet,
    judging: TrainingSet,
    seed: int,
    facts: dict[str, Any],
) -> Estimator:
    """Return the estimator with its limits, and how it was judged among its facts."""
    setup, space = answering.setup, answering.setup.space

    def looked_at(draws: TrainingSet, name: str) -> tuple[list[Mixture], Array, Array, Array]:
        """Return answers, and what is limited: distances, ratios and predicted errors."""
        rows = with_noise(draws, noise_rms(setup), stream(seed, f"noise of the {name}"))

        def of_part(part: slice, number: int) -> tuple[list[Mixture], Array, Array, Array]:
            answers = answering.answers(rows[part])
            features, ratios = answering.compared(rows[part], answers, stream(seed, "likeness", name, number))
            return answers, answering.distances(rows[part]), ratios, predictor.predicted(features)

        parts = list(of_parts(of_part, len(rows), LOOKED_AT_ONCE))
        answers = [one for part in parts for one in part[0]]
        distances, ratios, errors = (np.concatenate([part[i] for part in parts]) for i in (1, 2, 3))
        return answers, distances, ratios, errors

    limits = limits_of(*looked_at(validation, "calibration")[1:])
    answers, *found = looked_at(judging, "judgement")
    rng = stream(seed, "samples of the judgement")
    judgement = judged(answers, judging.points.astype(float), space, rng)
    beyond = float(np.mean(are_beyond(limits, *found)))
    facts = {
        **facts,
        "notes": [*facts["notes"], *([judgement.poor] if judgement.poor else [])],
        "judgement": _judgement_dict(judgement, space.coordinates) | {"not_believed": beyond},
    }
    first = answering.first
    return Estimator(
        setup,
        first.projection,
        first.network,
        answering.update,
        answering.temperature,
        predictor,
        limits,
        facts,
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
