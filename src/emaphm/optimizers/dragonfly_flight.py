"""Compiled inner loop of the dragonfly algorithm: the agents' moves in one iteration, one after another."""

import numpy as np
from numba import njit

from emaphm.arrays import Array


@njit(cache=True)
def fly(
    swarm: tuple[Array, Array, Array],
    scene: tuple[Array, Array, Array, Array, Array],
    weights: tuple[float, float, float, float, float, float],
    chance: tuple[Array, Array],
    thesis: bool,
) -> None:
    """Move each agent of `swarm` (positions, velocities, neighbours) in turn, in place.

    `scene` are the bounds, the radius, the food and the enemy; `weights` are s, a, c, f, e, w; `chance` are
    uniform numbers (n, 3, d) and Lévy steps (n, d); `thesis` selects the variant. The code loops over
    components because array expressions take three times as long to compile.
    """
    positions, velocities, neighbours = swarm
    lower, upper, radius, food, enemy = scene
    s, a, c, f, e, w = weights
    dice, levy = chance
    patterns = np.empty((3, lower.size))
    S, A, C = patterns
    for i in range(positions.shape[0]):
        if not thesis:
            neighbours[:] = 0.0
        count = _set_patterns(patterns, i, positions, velocities, neighbours, radius)
        near_food = _is_near(positions[i], food, radius)
        near_enemy = _is_near(positions[i], enemy, radius)
        for k in range(lower.size):
            x, v = positions[i, k], velocities[i, k]
            if near_food:
                pull = s * S[k] + a * A[k] + c * C[k] + f * (food[k] - x)
                if near_enemy:
                    pull += e * (enemy[k] + x if thesis else enemy[k] - x)
            else:
                pull = dice[i, 0, k] * A[k] + dice[i, 1, k] * C[k] + dice[i, 2, k] * S[k]
            if near_food or count > 1:
                longest = (upper[k] - lower[k]) / 10
                v = min(max(w * v + pull, -longest), longest)
                x += v
            else:
                v = 0.0
                x += levy[i, k] * x
            positions[i, k], velocities[i, k] = min(max(x, lower[k]), upper[k]), v


@njit(cache=True)
def _set_patterns(
    patterns: Array, i: int, positions: Array, velocities: Array, neighbours: Array, radius: Array
) -> int:
    """Set the neighbours of agent `i` and its `patterns` S, A, C; return the number of neighbours."""
    S, A, C = patterns
    patterns[:] = 0.0
    count = 0
    for j in range(positions.shape[0]):
        if _are_neighbours(positions[i], positions[j], radius):
            for k in range(radius.size):
                neighbours[count, k] = positions[j, k]
                S[k] += positions[i, k] - positions[j, k]
                A[k] += velocities[j, k]
            count += 1
    if count < 2:
        for k in range(radius.size):
            S[k], A[k] = 0.0, velocities[i, k]
        return count
    for k in range(radius.size):
        for j in range(neighbours.shape[0]):
            C[k] += neighbours[j, k]
        A[k], C[k] = A[k] / count, C[k] / count - positions[i, k]
    return count


@njit(cache=True)
def _are_neighbours(x: Array, other: Array, radius: Array) -> bool:
    for k in range(x.size):
        distance = abs(x[k] - other[k])
        if distance > radius[k] or distance == 0:
            return False
    return True


@njit(cache=True)
def _is_near(x: Array, point: Array, radius: Array) -> bool:
    near = True
    for k in range(x.size):
        near &= abs(x[k] - point[k]) <= radius[k]
    return near
