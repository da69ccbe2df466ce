"""Doing one run of a study: record the case, search, and tell what came out as one row."""

import time
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.arrays import Array
from emaphm.diagnosis.diagnose import objective_for
from emaphm.diagnosis.error_metric import error_percent
from emaphm.estimation.search import search
from emaphm.recording import Recording, acquire
from emaphm.simulated_recording import simulate
from emaphm.simulation import model_named
from emaphm.study.plan import Manoeuvre, Task
from emaphm.study.revision import REVISION
from emaphm.version import VERSION

CURRENTS = {"torque": "current_A", "active": "current_active_A", "magnitude": "current_magnitude_A"}
"""The reference model's channel for each form of the equivalent current."""


@dataclass(frozen=True)
class Outcome:
    """What became of a task: its row, or the reason why there is none; `revision` made it."""

    index: int
    row: dict[str, Any] | None
    failure: str
    revision: str


def attempt(actuator: Actuator, manoeuvre: Manoeuvre, task: Task) -> Outcome:
    """Return the outcome of a run: one that fails must not take the others with it."""
    try:
        row = perform(actuator, manoeuvre, task)
    except Exception as error:  # noqa: BLE001 - another library's optimiser may raise anything
        return failed(task, error)
    return Outcome(task.index, row, "", REVISION)


def failed(task: Task, error: Exception) -> Outcome:
    """Return the outcome of a run that ended in `error`."""
    what = f"{task.case}, {task.contestant.label}, run {task.run}"
    return Outcome(
        task.index, None, f"{what}: {type(error).__name__}: {' '.join(str(error).split())}", REVISION
    )


def perform(actuator: Actuator, manoeuvre: Manoeuvre, task: Task) -> dict[str, Any]:
    """Return the row of one run (`emaphm.study.store.SCHEMA`); all but `seconds` is reproducible."""
    recording = _recording(actuator, manoeuvre, task)
    evaluations: list[int] = []
    fitnesses: list[float] = []
    bests: list[Array] = []

    def note(spent: int, fitness: float, faults: Array) -> None:
        evaluations.append(spent)
        fitnesses.append(fitness)
        bests.append(faults)

    began = time.perf_counter()
    # One thread a run: a study keeps the cores busy with runs side by side.
    method = task.contestant.chosen()
    model = model_named(task.model)
    objective = objective_for(recording, actuator, method, model, task.contestant.nuisances, workers=1)
    found = search(
        objective,
        method,
        fitness=task.fitness,
        max_corrections=task.contestant.turns,
        seed=task.seed,
        on_population=note,
    )
    seconds = time.perf_counter() - began
    faults = objective.space.faults(found.point)
    evaluations_spent, reference_runs = objective.problem.runs.of(model)
    return {
        "index": task.index,
        "case": task.case,
        "method": task.contestant.label,
        "model": task.model,
        "fitness": task.fitness,
        "equivalent": task.equivalent,
        "noise_A": task.noise_A,
        "run": task.run,
        "seed": task.seed,
        "truth": list(task.truth),
        "found": faults.tolist(),
        "error_percent": float(error_percent(task.truth, faults)),
        "fitness_value": found.cost,
        "evaluations": evaluations_spent,
        "reference_runs": reference_runs,
        "seconds": seconds,
        "curve_evaluations": evaluations,
        "curve_fitness": fitnesses,
        "curve_error_percent": error_percent(task.truth, np.array(bests)).tolist() if bests else [],
        "revision": REVISION,
        "version": VERSION,
    }


def _recording(actuator: Actuator, manoeuvre: Manoeuvre, task: Task) -> Recording:
    exact = _exact(actuator, manoeuvre, task.truth)
    recording = Recording(
        {
            "time_s": exact["time_s"],
            "command_rad": exact["command_rad"],
            "current_A": exact[CURRENTS[task.equivalent]],
        }
    )
    if not task.noise_A:
        return recording
    return acquire(recording, noise={"current_A": task.noise_A}, seed=task.seed)


@lru_cache(maxsize=64)
def _exact(actuator: Actuator, manoeuvre: Manoeuvre, truth: tuple[float, ...]) -> Recording:
    """Return the reference model's noise-free recording of a case; methods and runs share it."""
    command = Chirp(manoeuvre.amplitude, manoeuvre.start_hz, manoeuvre.stop_hz, manoeuvre.duration)
    return simulate(
        actuator,
        command,
        faults=Faults(*truth),
        duration=manoeuvre.duration,
        sample_rate=manoeuvre.sample_rate,
    )
