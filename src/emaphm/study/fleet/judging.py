"""What each way of predicting says of a synthetic unit at shares of its life, against its true end."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.fleet.synthetic import FleetPlan, SyntheticUnit
from emaphm.prognosis import Evidence, Prior
from emaphm.prognosis.evidence import follow
from emaphm.prognosis.metrics import Prediction, crps, probability_integral_transform
from emaphm.prognosis.prognose import lives
from emaphm.prognosis.settings import FORECAST
from emaphm.study.fleet.baselines import LONGEST_H, last_slope, mean_life, one_filter_a_component
from emaphm.study.fleet.clairvoyant import clairvoyant
from emaphm.study.fleet.drawn import EXACT, drawn_evidence
from emaphm.study.fleet.informed import informed

SHARES = (0.0, 0.25, 0.5, 0.75)
"""λ: of the way from the first check flight to the failure."""

ALPHA, BETA = 0.2, 0.5

LATE = 0.2
"""A median is late where it exceeds the true RUL by more than this share of it."""

WITH_FLEET, WITH_LARGER, ALONE, CLAIRVOYANT, LAW_AND_LEVEL, INFORMED, LINE, FILTER, MEAN = (
    "ours, with the fleet's prior",
    "ours, with a larger fleet's",
    "ours, general prior",
    "clairvoyant: law, parameters, level",
    "clairvoyant: law and level",
    "Bayes' rule, population known",
    "last slope",
    "one filter a component",
    "mean life of the fleet",
)
WAYS = (WITH_FLEET, WITH_LARGER, ALONE, CLAIRVOYANT, LAW_AND_LEVEL, INFORMED, FILTER, LINE, MEAN)

TRACKED = replace(FORECAST, paths=300)
"""Forecasts at every check flight: a risk of 5 % is then right to 1.3 %."""

HORIZON_H, RISK = 400.0, 0.05
"""A unit is warned of where its probability of failure within the horizon [h] exceeds the risk."""


@dataclass(frozen=True, eq=False)
class Case:
    """A unit that failed, its diagnoses, and what is known of the others: prior, and hours of failure.

    `larger` is the prior of a larger fleet, where there is one.
    """

    unit: SyntheticUnit
    evidence: Evidence
    prior: Prior
    lives: Sequence[float]
    larger: Prior | None = None


def judged(
    case: Case, plan: FleetPlan, actuator: Actuator, seed: int, *, tracked: bool = True
) -> dict[str, Any]:
    """Return the scores of each way at each share of life; if `tracked`, when ours and Bayes' first warn.

    Raises
    ------
    PrognosisError, MethodError
        Nothing can be predicted.
    """
    flights = np.array([one.hours for one in case.evidence.used])
    failure = float(case.unit.failure or np.inf)
    chosen = [int(np.searchsorted(flights, _reached(flights, failure, one), "right")) - 1 for one in SHARES]
    ways: dict[str, dict[str, Any]] = {}
    warned: dict[str, dict[str, Any]] = {}
    for name, prior in ((WITH_FLEET, case.prior), (WITH_LARGER, case.larger), (ALONE, Prior())):
        if prior is None:
            continue
        past = follow(case.evidence, prior, seed=seed).past
        samples = lives([past[i] for i in chosen], case.evidence, actuator)
        ways[name] = {
            str(share): _scores(*sample, failure) for share, sample in zip(SHARES, samples, strict=True)
        }
        if tracked and name == WITH_FLEET:
            warned[name] = _warning(lives(past, case.evidence, actuator, settings=TRACKED), failure)
    known = informed(case.evidence, plan, range(len(flights)))
    if tracked:
        warned[INFORMED] = _warning(list(zip(flights.tolist(), known, strict=True)), failure)
    knowing_level = _knowing_law_and_level(case.unit, plan, flights[chosen])
    for share, i, by_level in zip(SHARES, chosen, knowing_level, strict=True):
        hours = float(flights[i])
        until = _until(case.evidence, i)
        others: dict[str, Array] = {
            CLAIRVOYANT: clairvoyant(case.unit, hours, plan),
            LAW_AND_LEVEL: by_level,
            INFORMED: known[i],
            FILTER: one_filter_a_component(until, actuator, seed),
            LINE: last_slope(until, actuator),
            MEAN: mean_life(hours, case.lives),
        }
        for name, sample in others.items():
            ways.setdefault(name, {})[str(share)] = _scores(hours, sample, failure)
    return {
        "unit": case.unit.serial_number,
        "failure": failure,
        "failed": case.unit.failed,
        "law": next(one.law for one in case.unit.components if one.name == case.unit.failed),
        "diagnoses": len(case.evidence.observations),
        "explained": len(flights),
        "ways": ways,
        "warned": warned,
    }


def _knowing_law_and_level(unit: SyntheticUnit, plan: FleetPlan, hours: Array) -> list[Array]:
    """Return samples of the RUL [h] at increasing `hours` by the laws, and the levels at check flights."""
    laws = {one.name: one.law for one in unit.components}
    at = np.searchsorted(unit.check_flights(plan.interval), hours)
    return informed(drawn_evidence(unit, plan, EXACT), plan, at.tolist(), laws)


def _reached(flights: Array, failure: float, share: float) -> float:
    return float(flights[0] + share * (failure - flights[0]))


def _until(evidence: Evidence, last: int) -> Evidence:
    """Return what was known at the explained diagnosis number `last`."""
    used = evidence.used[: last + 1]
    return Evidence(evidence.unit, evidence.part_number, used[-1].hours, used)


def _scores(hours: float, sample: Array, failure: float) -> dict[str, Any]:
    """Return what is counted of one prediction; a RUL beyond what is looked at counts as `LONGEST_H`."""
    true, one = failure - hours, Prediction(hours, sample)
    return {
        "hours": hours,
        "true": true,
        "median": min(one.median, LONGEST_H),
        "low": min(one.quantile(0.05), LONGEST_H),
        "high": min(one.quantile(0.95), LONGEST_H),
        "within": one.share_within((1 - ALPHA) * true, (1 + ALPHA) * true),
        "transform": probability_integral_transform(one, true),
        "crps": crps(sample, true, longest=LONGEST_H),
        "certain": bool(sample.size == 1),
    }


def _warning(samples: list[tuple[float, Array]], failure: float) -> dict[str, Any]:
    """Return the true RUL [h] at the first warning, None without one, and the medians of all predictions."""
    hours = next((at for at, sample in samples if np.mean(sample <= HORIZON_H) > RISK), None)
    return {
        "remaining": None if hours is None else failure - hours,
        "track": [
            [at, *(min(Prediction(at, sample).quantile(p), LONGEST_H) for p in (0.05, 0.5, 0.95))]
            for at, sample in samples
        ],
    }
