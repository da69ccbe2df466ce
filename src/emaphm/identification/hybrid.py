"""The default method: space-filling starts, then damped least squares from the best of them."""

from collections.abc import Callable

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


def hybrid(
    problem: Problem,
    space: FaultSpace,
    seed: int,
    on_progress: Callable[[float], None] | None = None,
) -> Refined:
    """Return the refined points of the best starts; `on_progress` is told the fraction done."""
    iterations = 12
    d = space.dimensions
    starts = space.spread(space_filling(GLOBAL_POINTS, np.zeros(d), np.ones(d), seed))
    if on_progress:
        on_progress(0.05)
    misfits = np.mean((problem.recorded - problem.currents(space.faults(starts))) ** 2, axis=1)
    best = np.argsort(misfits, kind="stable")[:STARTS]
    found = refine(
        lambda points: problem.currents(space.faults(points)),
        problem.recorded,
        starts[best],
        space,
        iterations=iterations,
        on_iteration=(lambda i: on_progress(0.3 + 0.7 * i / iterations)) if on_progress else None,
    )
    return Refined(found.points, found.costs, found.evaluations + GLOBAL_POINTS)
