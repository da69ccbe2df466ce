"""Derivatives of simulated outputs by finite differences, for many points in one batch of simulations."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.space.parameter_space import Box

Simulate: TypeAlias = Callable[[Array], Array]
"""Maps points (n, d) to outputs (n, rows)."""

MOST_NUMBERS = 30_000_000
"""Largest number of outputs in memory, 240 MB; above it, replicated Jacobians are computed one by one."""


def one_sided_jacobians(simulate: Simulate, points: Array, outputs: Array, box: Box, step: float) -> Array:
    """Return the derivatives (m, d, rows) of `simulate` at `points` (m, d), whose `outputs` are (m, rows).

    Differences over `step`, directed inwards near a bound, and shorter if both bounds are near.
    """
    m, d = points.shape
    sides = [box.project(points[:, np.newaxis, :] + side * step * np.eye(d)) for side in (1, -1)]
    ahead, behind = (np.abs(np.einsum("mii->mi", side) - points) for side in sides)
    # Projection may move a point on a bound by its rounding error.
    forward = (ahead > (1 - 1e-6) * step) | (ahead >= behind)
    moved = np.where(forward[:, :, np.newaxis], *sides)
    steps = np.einsum("mii->mi", moved - points[:, np.newaxis, :])
    derivatives = simulate(moved.reshape(m * d, d)).reshape(m, d, -1)
    derivatives -= outputs[:, np.newaxis, :]
    derivatives /= steps[:, :, np.newaxis]
    return derivatives


def replicated_jacobians(
    simulate: Simulate, point: Array, box: Box, step: float, count: int, rng: np.random.Generator
) -> Array:
    """Return `count` Jacobians (count, d, rows) of `simulate` about random points near `point` (d,).

    Central differences over `step`; the points have a standard deviation of `step`. The outputs have kinks
    where the shaft sticks and breaks away: the errors that kinks cause differ between the replicates.
    """
    d = point.size
    centres = box.project(point + rng.normal(0.0, step, (count, d)))
    moves = step * np.eye(d)
    sides = box.project(
        np.concatenate([centres[:, np.newaxis] + moves, centres[:, np.newaxis] - moves], axis=1)
    )
    outputs = simulate(sides[0])
    rows = outputs.shape[1]
    if sides.shape[0] * sides.shape[1] * rows > MOST_NUMBERS:
        further = [simulate(replicate) for replicate in sides[1:]]
    else:
        further = (
            list(simulate(sides[1:].reshape(-1, d)).reshape(count - 1, 2 * d, rows)) if count > 1 else []
        )
    return np.array(
        [
            _central_differences(replicate, its_outputs, d)
            for replicate, its_outputs in zip(sides, [outputs, *further], strict=True)
        ]
    )


def _central_differences(sides: Array, outputs: Array, d: int) -> Array:
    """Return the Jacobian (d, rows) from `outputs` (2 d, rows) at the `sides` (2 d, d) of a point."""
    # A bound shortens a move, and a curved bound turns it: the actual moves are used.
    inverse = np.linalg.pinv(sides[:d] - sides[d:], rcond=1e-9)
    return np.asarray(inverse @ (outputs[:d] - outputs[d:]))
