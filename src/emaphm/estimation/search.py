"""Searching for the faults that explain a recording, by whichever method."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.errors import MethodError, nearest
from emaphm.estimation.bias_correction import Corrected, correct, has_reference, resolution
from emaphm.estimation.cost_functions import FITNESSES
from emaphm.estimation.methods import Method
from emaphm.estimation.multistart import descend, hybrid
from emaphm.estimation.nuisances import NuisanceSet
from emaphm.estimation.objective import Fit
from emaphm.estimation.parameter_space import FaultSpace
from emaphm.estimation.problem import Problem, comparable
from emaphm.optimizers import State, minimise
from emaphm.optimizers.base import generator
from emaphm.progress import Progress, subprogress
from emaphm.recording import Recording
from emaphm.simulation import Model

OnPopulation = Callable[[int, float, Array], None]
"""Told after each population: evaluations so far, least fitness so far, its normalised faults (8,)."""


MOST_SEARCHES, AGREE = 4, 0.02
"""Searches where more is left than noise and chaos make; two that end so close to each other will do."""


@dataclass(frozen=True, eq=False)
class Found:
    """Where a method ended: its point (d,), its fitness to the current, and what it took.

    `fit` is what was fitted in the end; `correction`, (rows,), was added to its outputs; `discrepancy`,
    where known, is what it should be at the point itself; `play` (d, d) is the covariance that the search
    adds to that of the data; `settled` is true where the reference model has seen no better point beside it.
    `evaluations` counts runs of the fitted model, `reference_runs` those of the reference model. The
    nuisances `suspected` were not asked for and stood out.
    """

    fit: Fit
    point: Array
    fitness: float
    correction: Array
    discrepancy: Array | None
    play: Array
    evaluations: int
    reference_runs: int
    settled: bool = False
    suspected: tuple[str, ...] = ()


def fit_of(
    recording: Recording,
    actuator: Actuator,
    method: Method,
    model: Model,
    nuisances: Sequence[str] | None,
    workers: int | None,
) -> Fit:
    """Return what `method` fits: with least squares every channel and the nuisances, else the current alone.

    `nuisances` are named, or the actuator's own where None; those that a channel makes known are left out.

    Raises
    ------
    MethodError
        A nuisance is unknown, or needs the electrical description that the actuator lacks; or the method
        estimates none.
    """
    if not method.refines:
        if nuisances:
            raise MethodError(
                f"method '{method.name}' estimates faults alone; leave out nuisance '{nuisances[0]}', or use "
                f"'{method.name}+lsq'"
            )
        return Fit.of(Problem.of(recording, actuator, model, workers), FaultSpace.of(actuator))
    unknown = NuisanceSet.of(actuator, nuisances, recording.names)
    possible = comparable(actuator)
    channels = tuple(name for name in possible if name == "current_A" or tells(recording, name))
    problem = Problem.of(recording, actuator, model, workers, channels)
    return Fit.of(problem, FaultSpace.of(actuator, unknown))


def tells(recording: Recording, name: str) -> bool:
    """Return whether a channel was recorded, and is more than an idle column of one value."""
    return name in recording and float(np.ptp(recording[name])) > 0


def search(
    fit: Fit,
    method: Method,
    *,
    fitness: str,
    turns: int,
    seed: int,
    suspecting: bool = False,
    on_progress: Progress | None = None,
    on_population: OnPopulation | None = None,
) -> Found:
    """Return where `method` ends; `turns` bounds the bias corrections of a method that refines.

    Where `suspecting`, it also estimates what else a corrected fit shows to be off its description.

    Raises
    ------
    MethodError
        The fitness is unknown, or fitness or model do not go with the method.
    """
    check_fitness(method, fitness)
    if not method.refines:
        return _population(fit, method, fitness, seed, on_progress, on_population)
    if fit.problem.model.switches:
        raise MethodError(
            f"method '{method.name}' needs derivatives, which drown in the {fit.problem.model.name} model's "
            "switching; use the averaged model, or a method without least squares"
        )
    if turns > 0 and has_reference(fit.problem):
        return _corrected(fit, method, turns, seed, on_progress, suspecting=suspecting)
    return _refined(fit, method, seed, on_progress)


def check_fitness(method: Method, fitness: str) -> None:
    """Refuse a fitness that is unknown or does not go with the method."""
    if fitness not in FITNESSES:
        raise MethodError(f"unknown fitness '{fitness}'{nearest(fitness, FITNESSES)}")
    if method.refines and fitness != "least_squares":
        raise MethodError(
            f"method '{method.name}' minimises least_squares; choose a swarm for fitness '{fitness}'"
        )


def _refined(fit: Fit, method: Method, seed: int, on_progress: Progress | None) -> Found:
    refined = hybrid(fit, seed, method.optimizer, subprogress(on_progress, 0.0, 0.8))
    nothing = np.zeros_like(fit.target)
    descended = descend(fit, refined.points[refined.best], nothing, generator(seed, 3))
    if on_progress is not None:
        on_progress(1.0)
    point, evaluations = descended.points[descended.best], refined.evaluations + descended.evaluations
    misfit = _misfit(fit, fit.outputs(point[np.newaxis])[0])
    return Found(fit, point, misfit, nothing, None, resolution(point.size), evaluations + 1, 0)


def _corrected(
    fit: Fit, method: Method, turns: int, seed: int, on_progress: Progress | None, *, suspecting: bool
) -> Found:
    found = _found_by_several(fit, method, turns, seed, on_progress)
    names: tuple[str, ...] = ()
    if suspecting:
        from emaphm.diagnosis.nuisance_selection import suspected

        found, names = suspected(found, turns, seed)
    return Found(
        found.fit,
        found.point,
        _misfit(found.fit, found.outputs + found.correction),
        found.correction,
        found.discrepancy,
        found.play,
        found.evaluations,
        found.reference_runs,
        found.settled,
        names,
    )


def _found_by_several(
    fit: Fit, method: Method, turns: int, seed: int, on_progress: Progress | None
) -> Corrected:
    """Return where the nearest of several searches leads: of one, where it leaves no more than it should."""
    found = _searched(fit, method, turns, seed, on_progress)
    for another in generator(seed, 4).integers(2**31, size=MOST_SEARCHES - 1):
        if found.excess <= 1:
            break
        other = _searched(fit, method, turns, int(another))
        agree = bool(np.all(np.abs(other.point - found.point) < AGREE))
        nearer = other if other.left < found.left else found
        found = replace(
            nearer,
            evaluations=found.evaluations + other.evaluations,
            reference_runs=found.reference_runs + other.reference_runs,
        )
        if agree:
            break
    return found


def _searched(
    fit: Fit, method: Method, turns: int, seed: int, on_progress: Progress | None = None
) -> Corrected:
    """Return where the global stage and the corrections after it lead."""
    refined = hybrid(fit, seed, method.optimizer, subprogress(on_progress, 0.0, 0.4))
    found = correct(fit, refined.points, turns, subprogress(on_progress, 0.4, 1.0))
    return replace(found, evaluations=found.evaluations + refined.evaluations)


def _misfit(fit: Fit, outputs: Array) -> float:
    """Return the mean squared residual of the current that `outputs` (rows,) leave."""
    return float(np.mean((fit.target - outputs)[: fit.problem.recording.samples] ** 2))


def _population(
    fit: Fit,
    method: Method,
    fitness: str,
    seed: int,
    on_progress: Progress | None,
    on_population: OnPopulation | None,
) -> Found:
    assert method.optimizer is not None  # noqa: S101 - only `hybrid` has none, and it refines
    problem, space = fit.problem, fit.space
    optimizer = method.optimizer(np.zeros(space.dimensions), np.ones(space.dimensions))
    measure = FITNESSES[fitness]

    def evaluate(unit: Array) -> Array:
        currents = fit.currents(space.spread(unit))
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
    play = resolution(point.size)
    return Found(fit, point, result.fitness, np.zeros_like(fit.target), None, play, result.evaluations, 0)
