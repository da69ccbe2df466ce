"""What a recording asks to be estimated too: nuisances that nobody named, tested by Rao's score.

A wrong inertia reads as a fault wherever it is taken as known, and leaves hardly more residual. But where
the recording can tell it, a step towards the better estimate leads away from nominal (Rao 1948; Engle 1984),
and descents from there leave a little less. It is then estimated with the rest, and kept if it still stands
out, by more than any actuator may be off, and less is left of the recording.
"""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.bias_correction import Corrected, correct, resolution
from emaphm.estimation.local_covariance import neighbourhood, slopes
from emaphm.estimation.multistart import descend
from emaphm.estimation.nuisances import RANGE, NuisanceSet, less_known
from emaphm.estimation.objective import Fit
from emaphm.estimation.parameter_space import FaultSpace
from emaphm.optimizers.base import generator

SUSPICIOUS, HINT = 1.0, 0.995
"""Standard errors off nominal that a nuisance is looked at from; share of the misfit that makes it suspect.

A score is only as good as derivatives at a wrong estimate: five percent of inertia made 1.6 to 7 of it, where
line voltage was recorded, the actuator as described up to 4. Descents tell them apart, under the correction
that is there: inertia left 0.998 at most, 0.98 mostly, the actuator as described 0.996 and more, but for one
recording in a hundred.
"""

BEYOND_DOUBT, LIKELY, TELLTALE = 3.0, 1.5, 0.95
"""Standard errors off nominal that the estimate of a suspect is kept from, or so many where less is left.

Five percent of inertia, once estimated, brought what is left down to 0.65 to 0.92 of its mean square, the
actuator as described by no more than chance, to 0.976.
"""

LOOKS = 2
"""Descents by which a nuisance is looked at."""

TELLING = 1.0
"""Standard error that a recording must tell a nuisance to, as a share of its prior's: else it is no use."""

LEAST = 0.5
"""What a nuisance must be off at least, as a share of its prior: so much is expected of every actuator."""

WIDER = 4.0
"""By this the prior of what stands out is widened: it would otherwise draw back what is beyond it."""


@dataclass(frozen=True, eq=False)
class _Suspect:
    """A nuisance, the fit and point (d,) that descents with it lead to, and what share they leave."""

    name: str
    fit: Fit
    point: Array
    share: float


def suspected(found: Corrected, turns: int, seed: int) -> tuple[Corrected, tuple[str, ...]]:
    """Return `found`, or what is found with the nuisances that stand out estimated too, and their names."""
    names: tuple[str, ...] = ()
    while True:
        suspects, evaluations = _suspects(found, names, seed)
        found = replace(found, evaluations=found.evaluations + evaluations)
        for suspect in suspects:
            tried = correct(suspect.fit, suspect.point[np.newaxis], turns)
            score, evaluations = _standing_out(tried, suspect.name, seed)
            evaluations += found.evaluations + tried.evaluations
            reference_runs = found.reference_runs + tried.reference_runs
            share = _share_left(tried, found)
            stands_out = (score >= BEYOND_DOUBT and share < 1) or (score >= LIKELY and share < TELLTALE)
            kept = stands_out and _matters(tried, suspect.name)
            found = replace(tried if kept else found, evaluations=evaluations, reference_runs=reference_runs)
            if kept:
                names = (*names, suspect.name)
                break
        else:
            return found, names


def _suspects(found: Corrected, names: tuple[str, ...], seed: int) -> tuple[list[_Suspect], int]:
    """Return what is suspicious of what is neither estimated nor known, and the simulations spent.

    The most suspicious comes first. `names` are those suspected before, whose estimates `found` has.
    """
    problem = found.fit.problem
    others = found.fit.space.nuisances.others(problem.actuator, problem.recording.names)
    if not others:
        return [], 0
    wide, start = _widened(found, names, others)
    derivatives, spent = slopes(wide, start, seed)
    result = []
    for name in others:
        fit, point = _widened(found, names, (name,))
        # Derivatives were taken for all at once; each is judged as if it alone were estimated besides.
        kept = [i for i, other in enumerate(wide.space.coordinates) if other in fit.space.coordinates]
        near = neighbourhood(fit, point, found.residual[: fit.recorded_rows], derivatives[:, kept])
        i = fit.space.coordinates.index(name)
        error = float((near.covariance + resolution(point.size))[i, i] ** 0.5)
        score = float(abs(near.step[i])) / error
        if score > SUSPICIOUS and error < TELLING / RANGE / WIDER:
            there, share, more = _looked_at(fit, point + near.step, found, seed)
            spent += more
            if share < HINT:
                result.append(_Suspect(name, fit, there, share))
    return sorted(result, key=lambda suspect: suspect.share), spent


def _looked_at(fit: Fit, start: Array, found: Corrected, seed: int) -> tuple[Array, float, int]:
    """Return where descents lead from `start` (d,) under the correction of `found`.

    And the mean square that is left there, as a share of what `found` leaves; and the simulations spent.
    """
    rows = found.fit.recorded_rows
    correction = np.zeros_like(fit.target)
    correction[:rows] = found.discrepancy[:rows]
    descended = descend(fit, fit.space.project(start), correction, generator(seed, 5), LOOKS)
    there = descended.points[descended.best]
    left = (fit.target - fit.outputs(there[np.newaxis])[0] - correction)[:rows]
    share = float(np.mean(left**2) / np.mean(found.residual[:rows] ** 2))
    return there, share, descended.evaluations + 1


def _matters(found: Corrected, name: str) -> bool:
    """Return whether nuisance `name`, whose prior is wide, is off nominal by more than any may be."""
    value = found.point[found.fit.space.coordinates.index(name)]
    return bool(abs(value) > LEAST / RANGE / WIDER)


def _share_left(tried: Corrected, found: Corrected) -> float:
    """Return what `tried` leaves of the recorded channels, mean square, as a share of what `found` leaves."""
    rows = found.fit.recorded_rows
    ratios = found.fit.problem.weights / tried.fit.problem.weights
    left = tried.residual[:rows] * np.repeat(ratios, found.fit.problem.recording.samples)
    return float(np.mean(left**2) / np.mean(found.residual[:rows] ** 2))


def _standing_out(found: Corrected, name: str, seed: int) -> tuple[float, int]:
    """Return how many standard errors the estimate of `name` is off nominal, and the simulations spent."""
    fit, i = found.fit, found.fit.space.coordinates.index(name)
    derivatives, spent = slopes(fit, found.point, seed)
    near = neighbourhood(fit, found.point, found.residual[: fit.recorded_rows], derivatives)
    return float(abs(found.point[i]) / (near.covariance + found.play)[i, i] ** 0.5), spent


def _widened(found: Corrected, names: tuple[str, ...], more: tuple[str, ...]) -> tuple[Fit, Array]:
    """Return the fit with `more` nuisances estimated besides, and where `found` is in its space (d,).

    They have wide priors, as have `names`, which were suspected before.
    """
    fit = found.fit
    actuator, recorded = fit.problem.actuator, fit.problem.recording.names
    chosen = (*fit.space.nuisances.chosen, *more)
    unknown = NuisanceSet.of(less_known(actuator, (*names, *more), WIDER), chosen, recorded)
    wide = replace(fit, space=FaultSpace.of(actuator, unknown))
    values = dict(zip(fit.space.coordinates, found.point, strict=True))
    return wide, np.array([values.get(name, 0.0) for name in wide.space.coordinates])
