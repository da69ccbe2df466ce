"""From a recording to a diagnosis."""

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator import Actuator
from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.identification.correction import MOST_TURNS, PRIOR_DEVIATION, discrepancy, has_reference
from emaphm.identification.diagnosis import Diagnosis
from emaphm.identification.methods import method_named
from emaphm.identification.problem import Problem
from emaphm.identification.refinement import sensitivity
from emaphm.identification.search import Found, check_fitness, search
from emaphm.identification.space import FaultSpace
from emaphm.identification.uncertainty import covariance
from emaphm.identification.verdict import estimates, is_explained
from emaphm.recording import Recording, check_plausible
from emaphm.simulation import REFERENCE, model_named
from emaphm.version import VERSION

Array = NDArray[np.float64]
Progress = Callable[[float], None]

JACOBIAN_STEP = 2e-3


def diagnose(
    recording: Recording,
    actuator: Actuator,
    *,
    method: str = "hybrid",
    model: str = "averaged",
    fitness: str = "least_squares",
    turns: int = MOST_TURNS,
    seed: int = 0,
    workers: int | None = None,
    on_progress: Progress | None = None,
) -> Diagnosis:
    """Return the faults of `actuator` that explain `recording`, with their uncertainty.

    Parameters
    ----------
    method
        "hybrid" (space-filling starts, damped least squares, bias correction); an optimiser by name or
        abbreviation, at its published settings; or such a name with "+lsq", to have it find the starts
        of the least squares: see `emaphm.identification.methods`.
    model
        What reproduces the recording: "averaged"; an optimiser alone may also use "monitor", or
        "reference", slowly.
    fitness
        What an optimiser minimises: one of `FITNESSES`; least squares where they follow.
    turns
        Most corrections of the model's bias by the reference model (with least squares, actuators with an
        electrical description, recordings up to 30 s); 0 turns them off.
    seed, workers
        The same seed gives the same bits, whatever the number of threads.
    on_progress
        Called with the fraction done, from 0 to 1.

    Raises
    ------
    RecordingError
        The recording cannot be meant for this actuator, by orders of magnitude.
    MethodError
        A name is unknown, or fitness or model do not go with the method.
    """
    began = time.perf_counter()
    chosen = method_named(method)
    check_fitness(chosen, fitness)
    check_plausible(recording, actuator)
    problem = Problem.of(recording, actuator, model_named(model), workers)
    space = FaultSpace.of(actuator)
    found = search(problem, space, chosen, fitness=fitness, turns=turns, seed=seed, on_progress=on_progress)
    if found.discrepancy is None and has_reference(problem):
        found = _with_discrepancy(problem, space, found)
    return _conclude(problem, space, found, chosen.name, fitness, seed, began)


def _with_discrepancy(problem: Problem, space: FaultSpace, found: Found) -> Found:
    reference = Problem.of(problem.recording, problem.actuator, REFERENCE)
    remaining = discrepancy(problem, reference, space.faults(found.point))
    return replace(
        found,
        discrepancy=remaining,
        evaluations=found.evaluations + 1,
        reference_runs=found.reference_runs + 1,
    )


def _conclude(
    problem: Problem, space: FaultSpace, found: Found, method: str, fitness: str, seed: int, began: float
) -> Diagnosis:
    """Return the diagnosis at `found`.

    To the covariance of the fit is added the Gauss-Newton step that is left to do: towards the optimum
    that a swarm may not have reached, and for the model's discrepancy not yet corrected. And the search's
    resolution, which the kinks of stick-slip make no finer than the differences that bridge them.
    """
    faults = space.faults(found.point)
    modelled = problem.currents(faults[np.newaxis])[0] + found.correction
    residual = problem.recorded - modelled

    def simulate(points: Array) -> Array:
        return problem.currents(space.faults(points)) + found.correction

    derivatives, spent = sensitivity(simulate, found.point, space, JACOBIAN_STEP * np.eye(space.dimensions))
    spread = covariance(derivatives, residual, np.full(space.dimensions, PRIOR_DEVIATION))
    normal = derivatives @ derivatives.T
    prior = np.mean(residual**2) / PRIOR_DEVIATION**2 * np.eye(space.dimensions)
    bias = 0.0 if found.discrepancy is None else found.discrepancy - found.correction
    unanswered = residual - bias
    step = np.linalg.solve(normal + prior, derivatives @ unanswered)
    left = space.project(found.point + step) - found.point
    spread = spread + np.outer(left, left) + JACOBIAN_STEP**2 * np.eye(space.dimensions)
    return Diagnosis(
        components=estimates(space, found.point, spread),
        coordinates=tuple(CARTESIAN_NAMES[i] for i in space.columns),
        covariance=spread,
        method=method,
        model=problem.model.name,
        fitness_name=fitness,
        fitness=found.fitness,
        residual_rms_A=float(np.sqrt(np.mean(residual**2))),
        explained=is_explained(problem.recorded, residual),
        evaluations=found.evaluations + spent + 1,
        reference_runs=found.reference_runs,
        seconds=time.perf_counter() - began,
        seed=seed,
        recording=problem.recording.source,
        actuator=problem.actuator,
        version=VERSION,
        time_s=problem.recording["time_s"],
        recorded=problem.recorded,
        modelled=modelled,
    )
