"""Derivatives of simulated outputs by finite differences, for many points in one batch of simulations."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.space.parameter_space import Box

Simulate: TypeAlias = Callable[[Array], Array]
"""Maps points (n, d) to outputs (n, rows)."""

MOST_NUMBERS = 30_000_000
"""Outputs held at once, 240 MB; replicated Jacobians of a long recording are taken one after the other."""


def one_sided_jacobians(simulate: Simulate, points: Array, outputs: Array, box: Box, step: float) -> Array:
    """Return the derivatives of `simulate` at `points` (m, d) with `outputs` (m, rows): (m, d, rows).

    Differences over `step`, taken inward where a bound is near, and shorter where both are.
    """
    m, d = points.shape
    sides = [box.project(points[:, np.newaxis, :] + side * step * np.eye(d)) for side in (1, -1)]
    ahead, behind = (np.abs(np.einsum("mii->mi", side) - points) for side in sides)
    # Rounding alone may move a point that is on a bound.
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
    """Return `count` Jacobians (count, d, rows) of `simulate`, about points near `point` (d,).

    Central differences over `step`, each about a point of its own, about as far off. The outputs have kinks,
    where the shaft sticks and breaks away: the error that they make differs between the replicates.
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
        others = [simulate(one) for one in sides[1:]]
    else:
        others = list(simulate(sides[1:].reshape(-1, d)).reshape(count - 1, 2 * d, rows)) if count > 1 else []
    return np.array(
        [_central(side, of_side, d) for side, of_side in zip(sides, [outputs, *others], strict=True)]
    )


def _central(sides: Array, outputs: Array, d: int) -> Array:
    """Return the Jacobian (d, rows) from outputs at `sides` (2 d, d) of a point."""
    # At a bound a move is cut short, and near a curved one bent: the actual moves count.
    inverse = np.linalg.pinv(sides[:d] - sides[d:], rcond=1e-9)
    return np.asarray(inverse @ (outputs[:d] - outputs[d:]))
