"""Searching for the faults that explain a recording, by whichever method."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emaphm.errors import MethodError, nearest
from emaphm.identification.correction import correct, has_reference
from emaphm.identification.fitness import FITNESSES
from emaphm.identification.hybrid import hybrid
from emaphm.identification.methods import Method
from emaphm.identification.optimizers import State, minimise
from emaphm.identification.problem import Problem
from emaphm.identification.space import FaultSpace

Array = NDArray[np.float64]
Progress = Callable[[float], None]
OnPopulation = Callable[[int, float, Array], None]
"""Told after each population: evaluations so far, least fitness so far, its normalised faults (8,)."""


@dataclass(frozen=True, eq=False)
class Found:
    """Where a method ended: its point (d,) and fitness, and what it took.

    `correction` [A], (samples,), was added to the model's current; `discrepancy`, where known, is what it
    should be at the point itself. `evaluations` counts runs of the fitted model, `reference_runs` those of
    the reference model.
    """

    point: Array
    fitness: float
    correction: Array
    discrepancy: Array | None
    evaluations: int
    reference_runs: int


def search(
    problem: Problem,
    space: FaultSpace,
    method: Method,
    *,
    fitness: str,
    turns: int,
    seed: int,
    on_progress: Progress | None = None,
    on_population: OnPopulation | None = None,
) -> Found:
    """Return where `method` ends; `turns` bounds the bias corrections of a method that refines.

    Raises
    ------
    MethodError
        The fitness is unknown, or fitness or model do not go with the method.
    """
    check_fitness(method, fitness)
    if not method.refines:
        return _population(problem, space, method, fitness, seed, on_progress, on_population)
    if problem.model.switches:
        raise MethodError(
            f"method '{method.name}' needs derivatives, which drown in the {problem.model.name} model's "
            "switching; use the averaged model, or a method without least squares"
        )
    return _refined(problem, space, method, turns, seed, on_progress)


def check_fitness(method: Method, fitness: str) -> None:
    """Refuse a fitness that is unknown or does not go with the method."""
    if fitness not in FITNESSES:
        raise MethodError(f"unknown fitness '{fitness}'{nearest(fitness, FITNESSES)}")
    if method.refines and fitness != "least_squares":
        raise MethodError(
            f"method '{method.name}' minimises least_squares; choose a swarm for fitness '{fitness}'"
        )


def _refined(
    problem: Problem,
    space: FaultSpace,
    method: Method,
    turns: int,
    seed: int,
    on_progress: Progress | None,
) -> Found:
    corrects = turns > 0 and has_reference(problem)
    refined = hybrid(
        problem, space, seed, method.optimizer, _part(on_progress, 0.0, 0.4 if corrects else 1.0)
    )
    point, cost = refined.points[refined.best], float(refined.costs[refined.best])
    if not corrects:
        return Found(point, cost, np.zeros_like(problem.recorded), None, refined.evaluations, 0)
    corrected = correct(problem, space, point, turns, _part(on_progress, 0.4, 1.0))
    residual = problem.recorded - problem.currents(space.faults(corrected.point[np.newaxis]))[0]
    cost = float(np.mean((residual - corrected.correction) ** 2))
    evaluations = refined.evaluations + corrected.evaluations + 1
    return Found(
        corrected.point,
        cost,
        corrected.correction,
        corrected.discrepancy,
        evaluations,
        corrected.reference_runs,
    )


def _part(on_progress: Progress | None, first: float, last: float) -> Progress | None:
    """Return a progress function for the part of the work between two fractions."""
    if on_progress is None:
        return None
    return lambda fraction: on_progress(first + (last - first) * fraction)


def _population(
    problem: Problem,
    space: FaultSpace,
    method: Method,
    fitness: str,
    seed: int,
    on_progress: Progress | None,
    on_population: OnPopulation | None,
) -> Found:
    assert method.optimizer is not None  # noqa: S101 - only `hybrid` has none, and it refines
    optimizer = method.optimizer(np.zeros(space.dimensions), np.ones(space.dimensions))
    measure = FITNESSES[fitness]

    def evaluate(unit: Array) -> Array:
        currents = problem.currents(space.faults(space.spread(unit)))
        return measure(problem.recorded, currents, problem.inputs.interval)

    def tell(state: State) -> None:
        if on_progress is not None:
            on_progress(min(state.evaluations / optimizer.budget, 1.0))
        if on_population is not None:
            best = space.faults(space.spread(state.best_point[np.newaxis]))[0]
            on_population(state.evaluations, state.best_fitness, best)

    told: Any = tell if on_progress or on_population else None
    result = minimise(optimizer, evaluate, seed, told)
    point = space.spread(result.point[np.newaxis])[0]
    return Found(point, result.fitness, np.zeros_like(problem.recorded), None, result.evaluations, 0)
