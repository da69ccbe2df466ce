"""Hybrid methods: a global stage, then damped least squares from the best points that it came upon."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emaphm.identification.optimizers import Optimizer, minimise, space_filling
from emaphm.identification.problem import Problem
from emaphm.identification.refinement import Refined, refine
from emaphm.identification.space import FaultSpace

Array = NDArray[np.float64]

GLOBAL_POINTS = 256
"""Points of the global stage; a dragonfly swarm of as many evaluations finds no better starts."""

STARTS = 4
"""The best of them, refined."""

APART = 0.2
"""Least distance between two starts: a population gathers, and one start from each gathering is enough."""

STAGES = ((1e-2, 8), (2e-3, 12))
"""Finite-difference step and most iterations, one after the other: coarse steps see past the kinks that
stick-slip and heavy shorts make, fine ones settle between them."""


def hybrid(
    problem: Problem,
    space: FaultSpace,
    seed: int,
    optimizer: Callable[..., Optimizer[Any]] | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> Refined:
    """Return the refined points of the best starts.

    `optimizer`, made from lower and upper bounds, finds the starts; without one they are the best of
    `GLOBAL_POINTS` space-filling points. `on_progress` is told the fraction done.
    """
    d = space.dimensions
    lower, upper = np.zeros(d), np.ones(d)
    tried: list[Array] = []
    misfits: list[Array] = []

    def misfit(unit: Array) -> Array:
        points = space.spread(unit)
        tried.append(points)
        misfits.append(np.mean((problem.recorded - problem.currents(space.faults(points))) ** 2, axis=1))
        return misfits[-1]

    if optimizer is None:
        misfit(space_filling(GLOBAL_POINTS, lower, upper, seed))
    else:
        minimise(optimizer(lower, upper), misfit, seed)
    points = np.concatenate(tried)
    starts = _apart(points, np.concatenate(misfits))
    found = descend(problem, space, starts, np.zeros_like(problem.recorded), on_progress)
    return Refined(found.points, found.costs, found.evaluations + len(points))


def _apart(points: Array, misfits: Array) -> Array:
    """Return the best of `points` (n, d), none within `APART` of a better one, shape (≤ STARTS, d)."""
    chosen: list[Array] = []
    for i in np.argsort(misfits, kind="stable"):
        if all(np.linalg.norm(points[i] - other) > APART for other in chosen):
            chosen.append(points[i])
        if len(chosen) == STARTS:
            break
    return np.array(chosen)


def descend(
    problem: Problem,
    space: FaultSpace,
    starts: Array,
    correction: Array,
    on_progress: Callable[[float], None] | None = None,
) -> Refined:
    """Return where damped least squares lead from `starts` (m, d), stage by stage.

    `correction` [A], (samples,), is added to the model's current.
    """
    points, evaluations = starts, 0
    for stage, (step, iterations) in enumerate(STAGES):
        found = refine(
            lambda points: problem.currents(space.faults(points)) + correction,
            problem.recorded,
            points,
            space,
            step=step,
            iterations=iterations,
            on_iteration=partial(_tell, on_progress, stage, iterations) if on_progress else None,
        )
        points, evaluations = found.points, evaluations + found.evaluations
    return Refined(points, found.costs, evaluations)


def _tell(on_progress: Callable[[float], None], stage: int, iterations: int, iteration: int) -> None:
    on_progress((stage + iteration / iterations) / len(STAGES))
