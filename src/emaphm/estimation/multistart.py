"""Hybrid methods: a global stage, then damped least squares from the best points that it came upon."""

from collections.abc import Callable
from typing import Any

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.levenberg_marquardt import Refined, refine
from emaphm.estimation.objective import Fit
from emaphm.optimizers import Optimizer, minimise, space_filling

GLOBAL_POINTS = 128
"""Points of the global stage where no optimiser makes it."""

SMOOTHING_S = 4e-3
"""Standard deviation of a Gaussian low-pass on the currents [s].

It takes away the detail of commutation, ripple and stick-slip that makes false minima under heavy shorts:
half and twice as much serve nearly as well, none at all or 16 ms lose most runs of the multiple-fault case.
"""

BLOCKS = 4
"""Rows kept in a standard deviation of the low-pass."""

SMOOTH_STARTS, SHARP_STARTS = 3, 2
"""Best of the points with and without the low-pass: where it is not needed, it ends a little farther off."""

APART = 0.2
"""Least distance between two starts: a population gathers, and one start from each gathering is enough."""

DESCENTS, BESIDE = 4, 4e-3
"""Descents of the fine stage from about a point, and how far apart they start (rms of each dimension)."""

COARSE, FINE = (1e-2, 8, 3e-2), (2e-3, 12, 1e-2)
"""Finite-difference step, most iterations, and the share of its misfit that an iteration must gain to go on.

Coarse steps see past the kinks that stick-slip and heavy shorts make, fine ones settle between them. What
chaos makes of a misfit is more than the least gain.
"""


def hybrid(
    fit: Fit,
    seed: int,
    optimizer: Callable[..., Optimizer[Any]] | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> Refined:
    """Return the refined points of the best starts.

    `optimizer`, made from lower and upper bounds, finds the starts; without one they are the best of
    `GLOBAL_POINTS` space-filling points. `on_progress` is told the fraction done.
    """
    d = fit.space.dimensions
    lower, upper = np.zeros(d), np.ones(d)
    recorded = fit.problem.recorded
    tried: list[Array] = []
    sharp: list[Array] = []
    smooth: list[Array] = []

    def misfit(unit: Array) -> Array:
        tried.append(fit.space.spread(unit))
        residuals = recorded - fit.currents(tried[-1])
        sharp.append(np.mean(residuals**2, axis=1))
        smooth.append(np.mean(_low_pass(fit, residuals) ** 2, axis=1))
        return smooth[-1]

    if optimizer is None:
        misfit(space_filling(GLOBAL_POINTS, lower, upper, seed))
    else:
        minimise(optimizer(lower, upper), misfit, seed)
    points = np.concatenate(tried)
    candidates: list[Array] = []
    evaluations = len(points)
    for misfits, count, smoothed in ((smooth, SMOOTH_STARTS, True), (sharp, SHARP_STARTS, False)):
        starts = _apart(points, np.concatenate(misfits), count)
        tell = _stage_of(on_progress, len(candidates), COARSE)
        found = _descend(fit, starts, COARSE, smoothed=smoothed, on_iteration=tell)
        candidates.append(found.points[found.best])
        evaluations += found.evaluations
    fine = _descend(fit, np.array(candidates), FINE, on_iteration=_stage_of(on_progress, 2, FINE))
    return Refined(fine.points, fine.costs, evaluations + fine.evaluations)


def _apart(points: Array, misfits: Array, count: int) -> Array:
    """Return up to `count` of the best of `points` (n, d), none within `APART` of a better one."""
    chosen: list[Array] = []
    for i in np.argsort(misfits, kind="stable"):
        if all(np.linalg.norm(points[i] - other) > APART for other in chosen):
            chosen.append(points[i])
        if len(chosen) == count:
            break
    return np.array(chosen)


def _stage_of(
    on_progress: Callable[[float], None] | None, done: int, stage: tuple[float, int, float]
) -> Callable[[int], None] | None:
    """Return what tells the progress within one of the three descents, `done` of them behind it."""
    if on_progress is None:
        return None
    return lambda iteration: on_progress((done + iteration / stage[1]) / 3)


def descend(
    fit: Fit, point: Array, correction: Array, rng: np.random.Generator, count: int = DESCENTS
) -> Refined:
    """Return where `count` descents of the fine stage lead, from `point` (d,) and from points beside it.

    A descent is caught in the kinks of stick-slip, in whichever happens to lie in its way: several, from
    starts close together, are not all caught. `correction`, shape (rows,), is added to the model's
    `Fit.outputs`.
    """
    beside = point + rng.normal(0.0, BESIDE, (count - 1, point.size))
    return _descend(fit, fit.space.project(np.vstack([point, beside])), FINE, correction=correction)


def _descend(
    fit: Fit,
    starts: Array,
    stage: tuple[float, int, float],
    *,
    smoothed: bool = False,
    correction: Array | float = 0.0,
    on_iteration: Callable[[int], None] | None = None,
) -> Refined:
    step, iterations, least_gain = stage

    def seen(outputs: Array) -> Array:
        return _low_pass(fit, outputs) if smoothed else outputs

    return refine(
        lambda points: seen(fit.outputs(points) + correction),
        seen(fit.target),
        starts,
        fit.space,
        step=step,
        iterations=iterations,
        tolerance=least_gain,
        on_iteration=on_iteration,
    )


def _low_pass(fit: Fit, outputs: Array) -> Array:
    """Return the channels in `outputs` (…, rows) through the low-pass, and what follows them as it is.

    Of what is smooth, few rows tell all: means over `BLOCKS` of a standard deviation each stand for theirs.
    """
    from scipy.ndimage import gaussian_filter1d

    recording = fit.problem.recording
    samples, rows = recording.samples, fit.recorded_rows
    deviation = SMOOTHING_S / recording.interval_s
    block = int(np.clip(deviation / BLOCKS, 1, samples))
    channels = outputs[..., :rows].reshape(*outputs.shape[:-1], -1, samples)
    means = channels[..., : samples // block * block].reshape(*channels.shape[:-1], -1, block).mean(axis=-1)
    smooth = block**0.5 * gaussian_filter1d(means, deviation / block, axis=-1, mode="nearest")
    return np.concatenate([smooth.reshape(*outputs.shape[:-1], -1), outputs[..., rows:]], axis=-1)
