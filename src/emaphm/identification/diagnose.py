"""From a recording to a diagnosis."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator import Actuator
from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.errors import MethodError, nearest
from emaphm.identification.correction import MOST_TURNS, correct, discrepancy, has_reference
from emaphm.identification.diagnosis import Diagnosis
from emaphm.identification.fitness import FITNESSES
from emaphm.identification.hybrid import hybrid
from emaphm.identification.optimizers import Dragonfly, DragonflyState, Optimizer, minimise
from emaphm.identification.problem import Problem
from emaphm.identification.refinement import sensitivity
from emaphm.identification.space import FaultSpace
from emaphm.identification.uncertainty import covariance
from emaphm.identification.verdict import PRIOR_DEVIATION, estimates, is_explained
from emaphm.recording import Recording, check_plausible
from emaphm.simulation import REFERENCE, model_named
from emaphm.version import VERSION

Array = NDArray[np.float64]
Progress = Callable[[float], None]

JACOBIAN_STEP = 2e-3

SWARMS: dict[str, Callable[[int], Optimizer[DragonflyState]]] = {
    "dragonfly": lambda d: Dragonfly(np.zeros(d), np.ones(d), variant="corrected"),
    "dragonfly-thesis": lambda d: Dragonfly(np.zeros(d), np.ones(d), variant="thesis"),
}
"""Population-based methods by name: the optimiser of d normalised faults, at its published settings."""

METHODS = ("hybrid", *SWARMS)


@dataclass(frozen=True, eq=False)
class _Found:
    """Where a method ended: its point (d,), fitness, and the correction [A] its model was given."""

    point: Array
    fitness: float
    correction: Array
    discrepancy: Array
    evaluations: int
    reference_runs: int


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
        One of `METHODS`: "hybrid" (space-filling starts, damped least squares, bias correction), or a
        swarm at its published settings.
    model
        What reproduces the recording: "averaged"; a swarm may also use "monitor", or "reference", slowly.
    fitness
        What a swarm minimises: one of `FITNESSES`; `hybrid` minimises least squares.
    turns
        Most corrections of the model's bias by the reference model (`hybrid`, actuators with an
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
    _check_names(method, fitness)
    check_plausible(recording, actuator)
    problem = Problem.of(recording, actuator, model_named(model), workers)
    space = FaultSpace.of(actuator)
    if method == "hybrid":
        if problem.model.switches:
            raise MethodError(
                f"method 'hybrid' needs derivatives, which drown in the {model} model's switching; "
                "use the averaged model, or a swarm"
            )
        found = _hybrid(problem, space, turns, seed, on_progress)
    else:
        found = _swarm(problem, space, method, fitness, seed, on_progress)
    return _conclude(problem, space, found, method, fitness, seed, began)


def _check_names(method: str, fitness: str) -> None:
    if method not in METHODS:
        raise MethodError(f"unknown method '{method}'{nearest(method, METHODS)}")
    if fitness not in FITNESSES:
        raise MethodError(f"unknown fitness '{fitness}'{nearest(fitness, FITNESSES)}")
    if method == "hybrid" and fitness != "least_squares":
        raise MethodError(f"method 'hybrid' minimises least_squares; choose a swarm for fitness '{fitness}'")


def _hybrid(
    problem: Problem, space: FaultSpace, turns: int, seed: int, on_progress: Progress | None
) -> _Found:
    corrects = turns > 0 and has_reference(problem)
    refined = hybrid(problem, space, seed, _part(on_progress, 0.0, 0.4 if corrects else 1.0))
    point, cost = refined.points[refined.best], float(refined.costs[refined.best])
    if not has_reference(problem):
        nothing = np.zeros_like(problem.recorded)
        return _Found(point, cost, nothing, nothing, refined.evaluations, 0)
    corrected = correct(problem, space, point, turns, _part(on_progress, 0.4, 1.0))
    residual = problem.recorded - problem.currents(space.faults(corrected.point[np.newaxis]))[0]
    cost = float(np.mean((residual - corrected.correction) ** 2))
    evaluations = refined.evaluations + corrected.evaluations + 1
    return _Found(corrected.point, cost, corrected.correction, corrected.discrepancy, evaluations, turns + 1)


def _part(on_progress: Progress | None, first: float, last: float) -> Progress | None:
    """Return a progress function for the part of the work between two fractions."""
    if on_progress is None:
        return None
    return lambda fraction: on_progress(first + (last - first) * fraction)


def _swarm(
    problem: Problem, space: FaultSpace, method: str, fitness: str, seed: int, on_progress: Progress | None
) -> _Found:
    optimizer = SWARMS[method](space.dimensions)
    measure = FITNESSES[fitness]

    def evaluate(unit: Array) -> Array:
        currents = problem.currents(space.faults(space.spread(unit)))
        return measure(problem.recorded, currents, problem.inputs.interval)

    result = minimise(
        optimizer,
        evaluate,
        seed,
        (lambda state: on_progress(state.iteration / optimizer.iterations)) if on_progress else None,
    )
    point = space.spread(result.point[np.newaxis])[0]
    nothing = np.zeros_like(problem.recorded)
    if not has_reference(problem):
        return _Found(point, result.fitness, nothing, nothing, result.evaluations, 0)
    reference = Problem.of(problem.recording, problem.actuator, REFERENCE)
    remaining = discrepancy(problem, reference, space.faults(point))
    return _Found(point, result.fitness, nothing, remaining, result.evaluations + 1, 1)


def _conclude(
    problem: Problem, space: FaultSpace, found: _Found, method: str, fitness: str, seed: int, began: float
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

    derivatives, spent = sensitivity(simulate, found.point, space, JACOBIAN_STEP)
    spread = covariance(derivatives, residual, np.full(space.dimensions, PRIOR_DEVIATION))
    normal = derivatives @ derivatives.T
    prior = np.mean(residual**2) / PRIOR_DEVIATION**2 * np.eye(space.dimensions)
    unanswered = residual - (found.discrepancy - found.correction)
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
