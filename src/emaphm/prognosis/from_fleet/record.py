"""Outcomes of predictions of the fleet's failed units, each predicted from the others."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.faults import lower_bounds
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
"""Least number of failed units for a recalibration."""

AT = (0.1, 0.3, 0.5, 0.7, 0.85, 1.0)
"""Shares of a past unit's diagnoses after which its failure is predicted."""

PATHS = replace(FORECAST, paths=300)
"""Forecast settings of these predictions; median and spread have errors of some percent."""

RECORDS: Memory[Recalibration] = Memory(8)


def record_of(
    units: Sequence[Evidence],
    prior_of: Callable[[int], Prior],
    about: object,
    actuator: Actuator,
    seed: int,
) -> Recalibration | None:
    """Return the recalibration from predictions of failed `units`, each with the prior from the others.

    It is None if there are too few units, or if a requirement is a measure, whose failure times take too
    long. A process computes it once until a unit changes. Errors as in `uncorrected` and `follow`.

    Parameters
    ----------
    prior_of
        Returns the prior of a unit, given its index in `units`; a prior has some megabytes, and is not kept.
    about
        Common inputs of these priors, identified by their `repr`.
    """
    limits = Requirements(actuator).limits
    if len(units) < FEWEST_FAILED or any(limit.component is None for limit in limits):
        return None
    keys = [fingerprint(unit) for unit in units]
    # All that a prediction needs of an actuator: its limits, stated or by default, and its least friction.
    bounds = [(limit.component, limit.bound, limit.upper) for limit in limits]
    least = lower_bounds(actuator).tolist()

    def record() -> Recalibration:
        outcomes = (_outcome(unit, prior_of(i), actuator, seed) for i, unit in enumerate(units))
        return Recalibration([outcome for outcome in outcomes if outcome is not None])

    return RECORDS.get(repr((keys, bounds, least, about, seed)), record)


def _outcome(evidence: Evidence, prior: Prior, actuator: Actuator, seed: int) -> PastForecasts | None:
    """Return past forecasts of a unit with their errors; None if none before a failure had a median."""
    failure_at = _predicted_observations(evidence, Requirements(actuator).limits)
    settings = FILTER.for_updates(len(evidence.used))
    states = follow(evidence, prior.of(actuator), seed=seed, settings=settings, past=failure_at).past
    if not states:
        return None
    forecasts = uncorrected(states, evidence, actuator, PATHS)
    situations, error = [], []
    for belief, times, failure in zip(states, forecasts, failure_at.values(), strict=True):
        median, spread = log_rul(times.first)
        true_rul = failure - belief.hours
        if true_rul > 0 and np.isfinite(median):
            situations.append(situation_of(times.hours, belief.age))
            error.append((np.log(true_rul) - median) / spread)
    return (
        PastForecasts(evidence.unit, ForecastSituation.of(situations), np.array(error))
        if situations
        else None
    )


def _predicted_observations(evidence: Evidence, limits: Sequence[Limit]) -> dict[int, float]:
    """Return the indices of the observations to predict from, increasing, each with the next failure [h].

    A unit with wider limits, which was flown beyond one of `limits`, counts as failed when it passed this
    limit.
    """
    failure_at: dict[int, float] = {}
    for start, failure in evidence.failed_lives:
        life = [diagnosis for diagnosis in evidence.used if start < diagnosis.hours <= failure]
        end = min(failure, passed_at(life, limits))
        indices = [i for i, diagnosis in enumerate(evidence.used) if start < diagnosis.hours <= end]
        if indices:
            failure_at |= {
                indices[i]: end for i in sorted({round(share * (len(indices) - 1)) for share in AT})
            }
    return failure_at
