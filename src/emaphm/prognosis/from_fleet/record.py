"""How predictions of the fleet's past units turned out, each predicted from the others."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from emaphm.actuator import Actuator
from emaphm.memory import Memory
from emaphm.prognosis.evidence import Evidence
from emaphm.prognosis.filter.following import follow
from emaphm.prognosis.from_fleet.failures import passed_at
from emaphm.prognosis.from_fleet.fingerprint import fingerprint
from emaphm.prognosis.from_fleet.recalibration import (
    ForecastSituation,
    PastForecasts,
    Recalibration,
    log_rul,
    situation_of,
)
from emaphm.prognosis.prior import Prior
from emaphm.prognosis.prognose import uncorrected
from emaphm.prognosis.requirements import Requirements
from emaphm.prognosis.requirements.margins import Limit
from emaphm.prognosis.settings import FILTER, FORECAST

FEWEST_FAILED = 4
"""Units that have failed below which nothing is corrected."""

AT = (0.1, 0.3, 0.5, 0.7, 0.85, 1.0)
"""Shares of a past unit's diagnoses after which it is predicted."""

PATHS = replace(FORECAST, paths=300)
"""Of such a prediction: its median and spread are right to some percent."""

RECORDS: Memory[Recalibration] = Memory(8)


def record_of(
    units: Sequence[Evidence],
    prior_of: Callable[[int], Prior],
    about: object,
    actuator: Actuator,
    seed: int,
) -> Recalibration | None:
    """Return how predictions of `units` that failed turned out, each by the prior from the others.

    None where they are too few, or where a requirement is a measure: its failure times take too long.
    Computed once by a process until a unit changes. Errors as in `uncorrected` and `follow`.

    Parameters
    ----------
    prior_of
        Returns the prior of a unit by its place in `units`: some megabytes, so one after the other.
    about
        What these priors have in common, by its `repr`.
    """
    if len(units) < FEWEST_FAILED or any(one.component is None for one in Requirements(actuator).limits):
        return None
    keys = [fingerprint(one) for one in units]
    requirements = [one.model_dump() for one in actuator.requirements]

    def record() -> Recalibration:
        outcomes = (_outcome(one, prior_of(i), actuator, seed) for i, one in enumerate(units))
        return Recalibration([one for one in outcomes if one is not None])

    return RECORDS.get(repr((keys, requirements, about, seed)), record)


def _outcome(evidence: Evidence, prior: Prior, actuator: Actuator, seed: int) -> PastForecasts | None:
    """Return what became of the predictions of a unit; None where none before a failure had a median."""
    failure_at = _chosen(evidence, Requirements(actuator).limits)
    settings = FILTER.for_updates(len(evidence.used))
    chosen = follow(evidence, prior.of(actuator), seed=seed, settings=settings, past=failure_at).past
    if not chosen:
        return None
    forecasts = uncorrected(chosen, evidence, actuator, PATHS)
    situations, error = [], []
    for belief, times, failure in zip(chosen, forecasts, failure_at.values(), strict=True):
        middle, spread = log_rul(times.first)
        true = failure - belief.hours
        if true > 0 and np.isfinite(middle):
            situations.append(situation_of(times.hours, belief.age))
            error.append((np.log(true) - middle) / spread)
    return (
        PastForecasts(evidence.unit, ForecastSituation.of(situations), np.array(error))
        if situations
        else None
    )


def _chosen(evidence: Evidence, limits: Sequence[Limit]) -> dict[int, float]:
    """Return numbers of used observations of a unit, rising, and when the unit failed after each [h].

    A unit that went on beyond one of the `limits`, as its own were wider, failed when it passed that.
    """
    failure_at: dict[int, float] = {}
    for start, failure in evidence.failed_lives:
        life = [one for one in evidence.used if start < one.hours <= failure]
        end = min(failure, passed_at(life, limits))
        lived = [i for i, one in enumerate(evidence.used) if start < one.hours <= end]
        if lived:
            failure_at |= {lived[i]: end for i in sorted({round(share * (len(lived) - 1)) for share in AT})}
    return failure_at
