"""What a recording asks to be estimated too: nuisances that nobody named, tested by Rao's score.

A wrong inertia reads as a fault wherever it is taken as known, and leaves hardly more residual. But where
the recording can tell it, a step towards the better estimate leads many standard errors away from nominal
(Rao 1948; Engle 1984). It is then estimated with the rest, and kept if it still stands out, by more
than any actuator may be off, and less is left of the recording.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from emaphm.identification.correction import Corrected, correct, resolution
from emaphm.identification.fit import Fit
from emaphm.identification.neighbourhood import neighbourhood, slopes
from emaphm.identification.nuisance import RANGE, NuisanceSet, less_known
from emaphm.identification.space import FaultSpace

Array = NDArray[np.float64]

SUSPICIOUS, BEYOND_DOUBT = 2.0, 3.0
"""Standard errors off nominal that a nuisance is suspected from, and kept from once it is estimated.

A score is only as good as derivatives at a wrong estimate: five percent of inertia made 0.7 to 12 of it,
where line voltage was recorded, and the actuator as described up to 4. So little makes suspicious, and what
counts is what comes of estimating it: of 125 recordings by the actuator as described, nothing was kept.
"""

TELLING = 0.5
"""Standard error that a recording must tell a nuisance to, as a share of its prior's: else it is no use."""

LEAST = 0.5
"""What a nuisance must be off at least, as a share of its prior: so much is expected of every actuator."""

WIDER = 4.0
"""By this the prior of what stands out is widened: it would otherwise draw back what is beyond it."""


@dataclass(frozen=True, eq=False)
class _Suspect:
    """A nuisance, where a Gauss-Newton step with it leads, and how many standard errors off that is."""

    name: str
    fit: Fit
    point: Array
    score: float


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
            kept = score >= BEYOND_DOUBT and _matters(tried, suspect.name) and _nearer(tried, found)
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
            result.append(_Suspect(name, fit, fit.space.project(point + near.step), score))
    return sorted(result, key=lambda suspect: -suspect.score), spent


def _matters(found: Corrected, name: str) -> bool:
    """Return whether nuisance `name`, whose prior is wide, is off nominal by more than any may be."""
    value = found.point[found.fit.space.coordinates.index(name)]
    return bool(abs(value) > LEAST / RANGE / WIDER)


def _nearer(tried: Corrected, found: Corrected) -> bool:
    """Return whether `tried` leaves less of the recorded channels than `found`, by the weights of that."""
    rows = found.fit.recorded_rows
    ratios = found.fit.problem.weights / tried.fit.problem.weights
    left = tried.residual[:rows] * np.repeat(ratios, found.fit.problem.recording.samples)
    return float(np.mean(left**2)) < float(np.mean(found.residual[:rows] ** 2))


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
