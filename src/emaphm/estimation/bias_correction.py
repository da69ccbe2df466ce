"""Correcting the averaged model's bias with a few runs of the reference model (PHYSICS.md section 7).

The averaged model is not the reference model, so its best fit is biased. What separates the two at the
estimate is subtracted from the recording, and the fit repeated from there: space mapping, or a
multi-fidelity additive correction (Bandler et al. 2004; March and Willcox 2012).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.levenberg_marquardt import information, movable, scattered
from emaphm.estimation.multistart import DESCENTS, descend
from emaphm.estimation.objective import CORRELATED_ROWS, Fit
from emaphm.estimation.parameter_space import PRIOR_DEVIATION
from emaphm.estimation.problem import Problem, noise_level
from emaphm.optimizers.base import generator
from emaphm.simulation import REFERENCE

MOST_TURNS = 10

RUNS = 16
"""Runs of the reference model in a turn, shared by the points proposed: its kernel takes so many at once."""

APART = 1e-5
"""Distance of runs whose ripple is averaged: switching differs between them, and nothing else does."""

SHARES = np.array([[0.0], [0.3], [1.0]])
"""Proposals, from where a descent ends: shares of a step by derivatives about several points."""

STEP, POINTS = 2e-2, 4
"""The step of these derivatives' differences, and the points that they are taken about."""

DESCENTS_AGAIN, POINTS_AGAIN = 2, 2
"""Descents and points of a turn that follows one without progress: it adds to what was found there."""

FARTHEST = 0.1
"""Longest step of a proposal beyond the descent."""

ALIKE = 1.2
"""Misfits that differ by less are alike: chaos alone makes a recording's vary by some ten percent."""

BETTER, PATIENCE = 0.9, 3
"""What counts as progress of the misfit, and the turns without any after which it ends."""

RESOLUTION = 2e-4
"""Standard error taken for what kinks of stick-slip leave a descent of play, where it was not measured."""

LONGEST_S = 30.0
"""Recordings up to here are corrected: beyond, the reference model's steps would fill gigabytes."""


@dataclass(frozen=True, eq=False)
class Corrected:
    """An estimate and the `correction`, (rows,), that the `outputs` of its `fit` had when it was found.

    `discrepancy` is that correction as it stands at the estimate itself: the two differ by what a
    further turn would still change. `doubt` is its standard error by the chaos of switching, (rows,), and
    `chaos` [A²] the variance that this makes of the current in one run. `play` (d, d) is the covariance that
    the search itself adds to that of the data. `evaluations` counts the averaged model's runs,
    `reference_runs` the reference model's. `settled` is true where the reference model has seen no better
    beside it.
    """

    fit: Fit
    point: Array
    outputs: Array
    correction: Array
    discrepancy: Array
    doubt: Array
    chaos: float
    play: Array
    evaluations: int
    reference_runs: int
    settled: bool = False

    @property
    def residual(self) -> Array:
        """What was recorded less what the reference model has at the estimate, (rows,)."""
        return self.fit.target - self.outputs - self.discrepancy

    @property
    def misfit(self) -> float:
        """The mean squared `residual` [A²] less the share that the doubt has in it, at least 0."""
        return max(float(np.mean(self.residual**2) - np.mean(self.doubt**2)), 0.0)

    @property
    def excess(self) -> float:
        """The current's `residual` in multiples of what noise and chaos leave: at most 1 at the truth."""
        return float(np.sqrt(self.left / (noise_level(self.fit.problem.recorded) ** 2 + self.chaos)))

    @property
    def left(self) -> float:
        """The mean squared `residual` of the current [A²]."""
        return float(np.mean(self.residual[: self.fit.problem.recording.samples] ** 2))

    def reweighted(self) -> Self:
        """Return the estimate with its channels weighted by its residuals."""
        return self.under(self.fit.reweighted(self.residual))

    def under(self, fit: Fit) -> Self:
        """Return the same estimate with its rows weighted as `fit` weights them."""
        return replace(
            self,
            fit=fit,
            outputs=fit.rescaled(self.outputs, self.fit),
            correction=fit.rescaled(self.correction, self.fit),
            discrepancy=fit.rescaled(self.discrepancy, self.fit),
            doubt=fit.rescaled(self.doubt, self.fit),
        )


def resolution(dimensions: int) -> Array:
    """Return the covariance (d, d) that a search is taken to add where its play was not measured."""
    return RESOLUTION**2 * np.eye(dimensions)


def has_reference(problem: Problem) -> bool:
    """Return whether the reference model can run: windings described, the recording not too long."""
    return problem.actuator.electrical is not None and problem.recording.duration_s <= LONGEST_S


def correct(
    fit: Fit,
    points: Array,
    turns: int,
    on_progress: Callable[[float], None] | None = None,
) -> Corrected:
    """Return the estimate after up to `turns` corrections, from the best of `points` (n, d).

    Each turn proposes several points under the present correction, and asks the reference model how far
    each is from the recording. It takes the boldest of those that are as near as any, so never one that
    is farther than before by more than chaos makes of it. In the end, the mean of those that the turns
    without progress led to: the reference model cannot tell them apart.
    """
    reference = fit.problem.by(REFERENCE)
    started = _assessed(fit, points, np.zeros_like(fit.target), reference)
    current = min(started, key=lambda one: one.left)
    current = replace(
        current, evaluations=len(points), reference_runs=sum(one.reference_runs for one in started)
    )
    idle, alike, found = 0, list[Corrected](), None
    for turn in range(turns):
        current = current.reweighted()
        found = _beside(current, turn, found if idle else None)
        tried = _assessed(current.fit, found.proposals, current.discrepancy, reference)
        misfits = np.array([one.misfit for one in tried])
        bold = int(np.flatnonzero(misfits <= ALIKE * misfits.min())[-1])
        idle = 0 if misfits[bold] < BETTER * current.misfit else idle + 1
        taken = current
        if misfits[bold] <= ALIKE * current.misfit:
            taken = tried[bold]
            alike = [*alike, taken] if idle else []
        current = replace(
            taken,
            evaluations=current.evaluations + found.evaluations + len(tried),
            reference_runs=current.reference_runs + sum(one.reference_runs for one in tried),
            settled=idle == PATIENCE,
        )
        if current.settled:
            break
        if on_progress:
            on_progress((turn + 1) / turns)
    if on_progress:
        on_progress(1.0)
    return _mean(current, alike)


def _mean(current: Corrected, alike: list[Corrected]) -> Corrected:
    """Return the mean of estimates that the reference model cannot tell apart, if it is as near as they.

    What they scatter is the play of the search.
    """
    if len(alike) < 2:
        return current
    alike = [one.under(current.fit) for one in alike]
    points = np.array([one.point for one in alike])
    point, scatter = points.mean(axis=0), np.cov(points, rowvar=False)
    mean = replace(
        current,
        point=point,
        outputs=current.fit.outputs(point[np.newaxis])[0],
        correction=np.mean([one.correction for one in alike], axis=0),
        discrepancy=np.mean([one.discrepancy for one in alike], axis=0),
        play=scatter / len(alike),
        evaluations=current.evaluations + 1,
    )
    if mean.misfit <= ALIKE * current.misfit:
        return mean
    return replace(current, play=scatter, evaluations=mean.evaluations)


def assessed(fit: Fit, point: Array, reference: Problem) -> Corrected:
    """Return an estimate (d,) that was found without correction, with the discrepancy that it has."""
    return _assessed(fit, point[np.newaxis], np.zeros_like(fit.target), reference)[0]


def _assessed(fit: Fit, points: Array, correction: Array, reference: Problem) -> list[Corrected]:
    """Return estimates at `points` (n, d) with what the reference model has to say of them.

    Switching is chaotic, and one run's ripple no better than another's: the discrepancy is the mean over
    several runs about each point.
    """
    repeats = RUNS // len(points)
    outputs = fit.outputs(points)
    apart = generator(0, 2).normal(0.0, APART, (len(points), repeats, points.shape[1]))
    beside = fit.space.project(points[:, np.newaxis] + apart).reshape(-1, points.shape[1])
    runs = fit.by(reference).outputs(beside).reshape(len(points), repeats, -1)
    scatter = runs.var(axis=1, ddof=1)
    chaos = scatter[:, : fit.problem.recording.samples].mean(axis=1)
    play = resolution(points.shape[1])
    return [
        Corrected(
            fit,
            points[i],
            outputs[i],
            correction,
            runs[i].mean(axis=0) - outputs[i],
            (scatter[i] / repeats) ** 0.5,
            float(chaos[i]),
            play,
            1,
            repeats,
        )
        for i in range(len(points))
    ]


@dataclass(frozen=True, eq=False)
class _Beside:
    """What a turn finds beside an estimate: points (n, d) that may be nearer, and `evaluations` spent.

    And the `derivatives` (m, d, rows) about several points, as `fit` weights them.
    """

    fit: Fit
    proposals: Array
    derivatives: Array
    evaluations: int


def _beside(current: Corrected, turn: int, before: _Beside | None) -> _Beside:
    """Return what may be nearer under the present correction, where `before` was found in the same place.

    A Gauss-Newton step by derivatives about several points sees past the kinks of stick-slip in which a
    descent is caught, but may also lead astray.
    """
    fit, space = current.fit, current.fit.space
    descents, points = (DESCENTS, POINTS) if before is None else (DESCENTS_AGAIN, POINTS_AGAIN)
    descended = descend(fit, current.point, current.discrepancy, generator(turn, 3), descents)
    point = descended.points[descended.best]
    derivatives, spent = scattered(fit.outputs, point, space, STEP, points, seed=turn)
    if before is not None:
        derivatives = np.concatenate([fit.rescaled(before.derivatives, before.fit), derivatives])
    residual = fit.target - fit.outputs(point[np.newaxis])[0] - current.discrepancy
    gradient = derivatives.mean(axis=0) @ residual
    cost = float(np.mean(residual**2))
    normal = information(derivatives) + cost * CORRELATED_ROWS / PRIOR_DEVIATION**2 * np.eye(point.size)
    free = movable(point, gradient, space)
    step = np.zeros(point.size)
    step[free] = np.linalg.solve(normal[np.ix_(free, free)], gradient[free])
    step *= min(1.0, FARTHEST / max(float(np.linalg.norm(step)), FARTHEST))
    proposals = space.project(point + SHARES * step)
    return _Beside(fit, proposals, derivatives, descended.evaluations + spent + 1)
