"""What a recording asks to be estimated too: nuisances that nobody named, tested by Rao's score.

A wrong inertia reads as a fault wherever it is taken as known, and leaves hardly more residual. But where
the recording can tell it, a step towards the better estimate leads many standard errors away from nominal
(Rao 1948; Engle 1984). It is then estimated with the rest, and kept if it still stands out.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from emaphm.identification.correction import Corrected, correct
from emaphm.identification.fit import Fit
from emaphm.identification.neighbourhood import neighbourhood
from emaphm.identification.nuisance import NuisanceSet, less_known
from emaphm.identification.space import FaultSpace

Array = NDArray[np.float64]

SUSPICIOUS, BEYOND_DOUBT = 3.0, 3.0
"""Standard errors off nominal that a nuisance is suspected from, and kept from once it is estimated.

Of recordings by the actuator as described, the score reached 3.8 in one of sixteen and 2 in the others;
five percent of inertia made 5 to 12 of it in seven of ten, where line voltage was recorded.
"""


WIDER = 4.0
"""By this the prior of what stands out is widened: it would otherwise draw back what is beyond it."""


@dataclass(frozen=True, eq=False)
class _Suspect:
    """A nuisance, where a Gauss-Newton step with it leads, and how many standard errors off that is."""

    name: str
    fit: Fit
    point: Array
    score: float
    evaluations: int


def suspected(found: Corrected, turns: int, seed: int) -> tuple[Corrected, tuple[str, ...]]:
    """Return `found`, or what is found with the nuisances that stand out estimated too, and their names."""
    names: tuple[str, ...] = ()
    while True:
        suspects = _suspects(found, names, seed)
        found = replace(found, evaluations=found.evaluations + sum(one.evaluations for one in suspects))
        suspect = max(suspects, key=lambda one: one.score, default=None)
        if suspect is None or suspect.score < SUSPICIOUS:
            return found, names
        tried = correct(suspect.fit, suspect.point, turns)
        score, spent = _standing_out(tried, suspect.name, seed)
        evaluations = found.evaluations + tried.evaluations + spent
        reference_runs = found.reference_runs + tried.reference_runs
        if score < BEYOND_DOUBT:
            return replace(found, evaluations=evaluations, reference_runs=reference_runs), names
        found = replace(tried, evaluations=evaluations, reference_runs=reference_runs)
        names = (*names, suspect.name)


def _suspects(found: Corrected, names: tuple[str, ...], seed: int) -> list[_Suspect]:
    """Return the nuisances that are neither estimated nor known, `names` having been suspected before."""
    problem = found.fit.problem
    others = found.fit.space.nuisances.others(problem.actuator, problem.recording.names)
    return [_suspect(found, (*names, name), seed) for name in others]


def _suspect(found: Corrected, names: tuple[str, ...], seed: int) -> _Suspect:
    """Return the last of `names`, those before it being estimated already."""
    fit, faults = _widened(found.fit, names), len(found.fit.space.columns)
    before = dict(zip(found.fit.space.nuisances.names, found.point[faults:], strict=True))
    unknown = np.array([before.get(name, 0.0) for name in fit.space.nuisances.names])
    point = np.concatenate([found.point[:faults], unknown])
    near = neighbourhood(fit, point, found.residual[: fit.recorded_rows], seed)
    i = faults + fit.space.nuisances.names.index(names[-1])
    score = float(abs(near.step[i]) / near.covariance[i, i] ** 0.5)
    return _Suspect(names[-1], fit, fit.space.project(point + near.step), score, near.evaluations)


def _standing_out(found: Corrected, name: str, seed: int) -> tuple[float, int]:
    """Return how many standard errors the estimate of `name` is off nominal, and the simulations spent."""
    fit = found.fit
    near = neighbourhood(fit, found.point, found.residual[: fit.recorded_rows], seed)
    i = len(fit.space.columns) + fit.space.nuisances.names.index(name)
    return float(abs(found.point[i]) / near.covariance[i, i] ** 0.5), near.evaluations


def _widened(fit: Fit, names: tuple[str, ...]) -> Fit:
    """Return the fit with the last of `names` estimated besides, and wide priors of all of them."""
    actuator, recorded = fit.problem.actuator, fit.problem.recording.names
    chosen = (*fit.space.nuisances.chosen, names[-1])
    unknown = NuisanceSet.of(less_known(actuator, names, WIDER), chosen, recorded)
    return replace(fit, space=FaultSpace.of(actuator, unknown))
