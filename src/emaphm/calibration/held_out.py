"""Recordings left out of a joint fit, and their residuals under the parameters of that fit."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.joint.objective import JointObjective
from emaphm.estimation.joint.search import DESCENT
from emaphm.estimation.levenberg_marquardt import least_squares
from emaphm.estimation.space.parameter_space import Box
from emaphm.random_streams import stream


def folds(count: int, most: int, seed: int) -> list[set[int]]:
    """Return the groups of recordings to leave out: each of `count` once, in at most `most` groups."""
    groups = min(count, most)
    order = stream(seed, "folds").permutation(count)
    return [{int(r) for r in order[fold::groups]} for fold in range(groups)]


def subset(joint: JointObjective, point: Array, kept: Sequence[int]) -> tuple[JointObjective, Array]:
    """Return the objective of the recordings `kept`, and their coordinates of `point` (d,)."""
    part = replace(joint, terms=tuple(joint.terms[r] for r in kept))
    start = np.zeros(part.box.lower.size)
    for index, r in zip(part.indices, kept, strict=True):
        start[index] = joint.local(r, point)
    return part, start


def own_coordinates(joint: JointObjective, r: int, shared: Array) -> Array:
    """Return the own coordinates of recording `r` with the best fit under `shared` parameters (p,)."""
    term = joint.terms[r]
    own = np.zeros(term.own)
    if not term.own:
        return own
    space = term.objective.space

    def outputs(points: Array) -> Array:
        return term.outputs(np.concatenate([points, np.tile(shared, (len(points), 1))], axis=1))

    box = Box(space.lower[: term.own], space.upper[: term.own])
    return least_squares(outputs, term.target, own[np.newaxis], box, DESCENT).best


def left_out_residual(joint: JointObjective, r: int, shared: Array) -> Array:
    """Return the residual (rows,) of recording `r` under `shared` parameters (p,), with its own estimated."""
    term, own = joint.terms[r], own_coordinates(joint, r, shared)
    return term.objective.residual(np.concatenate([own, shared]), term.correction)
