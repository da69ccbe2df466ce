"""One trial of a study: simulate the recording of the case, identify the faults, and return the result."""

import time
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from emaphm.actuator import NAMES, Actuator, Faults
from emaphm.arrays import Array
from emaphm.calibration import calibrate
from emaphm.diagnosis.error_metric import error_percent
from emaphm.diagnosis.posing import objective_for
from emaphm.errors import StudyError
from emaphm.estimation.search import search
from emaphm.estimation.search_settings import SearchSettings
from emaphm.execution.revision import check_revision
from emaphm.recording import Recording, acquire
from emaphm.simulated_recording import simulate
from emaphm.simulation import model_named
from emaphm.study.record import recorded
from emaphm.study.revision import revision
from emaphm.study.rig import Manoeuvre, Rig
from emaphm.study.trials import Trial
from emaphm.version import VERSION

HEALTHY_RECORDINGS = 3
"""Number of healthy recordings with which the actuator of a rig is calibrated."""

FIRST_HEALTHY_SEED = 1_000_000
"""Seed of the first healthy recording, beyond the seeds of all cases."""

CURRENTS = {"torque": "current_A", "active": "current_active_A", "magnitude": "current_magnitude_A"}
"""The reference model's channel for each form of the equivalent current."""

NOT_DIAGNOSED: dict[str, Any] = {
    "lower95": None,
    "upper95": None,
    "standard_error": None,
    "verdict": None,
    "explained": None,
    "moves": None,
}
"""Columns of a diagnosis, which are null for a search without diagnosis."""


def perform(
    actuator: Actuator, manoeuvre: Manoeuvre, trial: Trial, expected: str, estimator_digest: str | None = None
) -> dict[str, Any]:
    """Return the result of one trial (`emaphm.study.store.MEASURED`), reproducible except for `seconds`.

    `estimator_digest` is the digest of the method's estimator at the start of the study
    (`DiagnosisSettings`).

    Raises
    ------
    StudyError
        The code of this process differs from that of revision `expected`.
    """
    check_revision(revision(), expected, "study", StudyError)
    # Otherwise the time of a worker's first trial would include the preparation.
    trial.contestant.chosen().prepare()
    if trial.rig is None:
        result = _searched(
            _exact_recording(actuator, manoeuvre, trial), actuator, trial, trial.contestant.nuisances or ()
        )
    else:
        recording = recorded(trial.rig, actuator, manoeuvre, Faults(*trial.truth), trial.seed)
        if trial.rig.stated:
            actuator = actuator.model_copy(update={"tolerances": trial.rig.tolerances})
        if trial.rig.calibrated:
            actuator = _calibrated(trial.rig, actuator, manoeuvre)
        if trial.contestant.chosen().least_squares:
            result = _diagnosed(recording, actuator, trial, estimator_digest)
        else:
            result = _searched(recording, actuator, trial, ())
    return {**result, "revision": expected, "version": VERSION}


def _diagnosed(
    recording: Recording, actuator: Actuator, trial: Trial, estimator_digest: str | None
) -> dict[str, Any]:
    """Return the result of `diagnose`, as a user would call it."""
    contestant = trial.contestant
    # One thread per trial, here and below: a study uses the cores by parallel trials.
    settings = replace(
        contestant.settings(trial.seed),
        model=trial.model,
        fitness=trial.fitness,
        estimator_digest=estimator_digest,
    )
    diagnosis = settings.diagnosed(recording, actuator)
    components = [diagnosis.components[name] for name in NAMES]
    return {
        "found": [estimate.value for estimate in components],
        "fitness_value": diagnosis.fitness,
        "evaluations": diagnosis.evaluations,
        "reference_runs": diagnosis.reference_runs,
        "seconds": diagnosis.seconds,
        "curve_evaluations": [],
        "curve_fitness": [],
        "curve_error_percent": [],
        "lower95": [estimate.interval95[0] for estimate in components],
        "upper95": [estimate.interval95[1] for estimate in components],
        "standard_error": [estimate.standard_error for estimate in components],
        "verdict": [estimate.verdict for estimate in components],
        "explained": diagnosis.explained,
        "moves": diagnosis.moves,
    }


@lru_cache(maxsize=64)
def _calibrated(rig: Rig, actuator: Actuator, manoeuvre: Manoeuvre) -> Actuator:
    """Return the actuator calibrated with the laws of the rig, on healthy recordings of the rig."""
    seeds = range(FIRST_HEALTHY_SEED, FIRST_HEALTHY_SEED + HEALTHY_RECORDINGS)
    recordings = [recorded(rig, actuator, manoeuvre, Faults(), seed) for seed in seeds]
    return calibrate(recordings, actuator, laws=rig.calibrated, workers=1).actuator


def _searched(
    recording: Recording, actuator: Actuator, trial: Trial, nuisances: tuple[str, ...]
) -> dict[str, Any]:
    """Return the end point of the search, with the curves of its convergence."""
    evaluations: list[int] = []
    fitnesses: list[float] = []
    bests: list[Array] = []

    def note(spent: int, fitness: float, faults: Array) -> None:
        evaluations.append(spent)
        fitnesses.append(fitness)
        bests.append(faults)

    began = time.perf_counter()
    method = trial.contestant.chosen()
    model = model_named(trial.model)
    # The thesis's cases have components in [0, 1], and its methods search there.
    objective = objective_for(recording, actuator, method, model, nuisances, workers=1, below_healthy=False)
    end = search(
        objective,
        SearchSettings(method, trial.contestant.max_corrections, trial.seed),
        fitness=trial.fitness,
        on_population=note,
    )
    seconds = time.perf_counter() - began
    evaluated, reference_runs = objective.problem.runs.of(model)
    return {
        "found": objective.space.faults(end.point).tolist(),
        "fitness_value": end.cost,
        "evaluations": evaluated,
        "reference_runs": reference_runs,
        "seconds": seconds,
        "curve_evaluations": evaluations,
        "curve_fitness": fitnesses,
        "curve_error_percent": error_percent(trial.truth, np.array(bests)).tolist() if bests else [],
        **NOT_DIAGNOSED,
    }


def _exact_recording(actuator: Actuator, manoeuvre: Manoeuvre, trial: Trial) -> Recording:
    exact = _exact(actuator, manoeuvre, trial.truth)
    recording = Recording(
        {
            "time_s": exact["time_s"],
            "command_rad": exact["command_rad"],
            "current_A": exact[CURRENTS[trial.equivalent]],
        }
    )
    if not trial.noise_A:
        return recording
    return acquire(recording, noise={"current_A": trial.noise_A}, seed=trial.seed)


@lru_cache(maxsize=64)
def _exact(actuator: Actuator, manoeuvre: Manoeuvre, truth: tuple[float, ...]) -> Recording:
    """Return the noise-free recording of a case by the reference model; all methods and runs share it."""
    return simulate(
        actuator,
        manoeuvre.chirp(actuator, manoeuvre.duration),
        faults=Faults(*truth),
        duration=manoeuvre.duration,
        sample_rate=manoeuvre.sample_rate,
    )
