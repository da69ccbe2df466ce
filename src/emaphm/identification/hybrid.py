"""The default method: space-filling starts, then damped least squares from the best of them."""

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from emaphm.identification.optimizers import space_filling
from emaphm.identification.problem import Problem
from emaphm.identification.refinement import Refined, refine
from emaphm.identification.space import FaultSpace

Array = NDArray[np.float64]

GLOBAL_POINTS = 256
"""Points of the global stage; a dragonfly swarm of as many evaluations finds no better starts."""

STARTS = 4
"""The best of them, refined."""

STAGES = ((1e-2, 8), (2e-3, 12))
"""Finite-difference step and most iterations, one after the other: coarse steps see past the kinks that
stick-slip and heavy shorts make, fine ones settle between them."""


def hybrid(
    problem: Problem,
    space: FaultSpace,
    seed: int,
    on_progress: Callable[[float], None] | None = None,
) -> Refined:
    """Return the refined points of the best starts; `on_progress` is told the fraction done."""
    d = space.dimensions
    starts = space.spread(space_filling(GLOBAL_POINTS, np.zeros(d), np.ones(d), seed))
    misfits = np.mean((problem.recorded - problem.currents(space.faults(starts))) ** 2, axis=1)
    best = np.argsort(misfits, kind="stable")[:STARTS]
    found = descend(problem, space, starts[best], np.zeros_like(problem.recorded), on_progress)
    return Refined(found.points, found.costs, found.evaluations + GLOBAL_POINTS)


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
