"""What each way of predicting says of a synthetic unit over its life, against its true end."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.fleet.synthetic import FleetPlan, SyntheticUnit
from emaphm.prognosis import Evidence, Prior
from emaphm.prognosis.filter.following import follow
from emaphm.prognosis.metrics import (
    Prediction,
    alpha_lambda,
    at_share_of_life,
    crps,
    probability_integral_transform,
)
from emaphm.prognosis.prognose import lives
from emaphm.prognosis.settings import FORECAST
from emaphm.study.fleet.baselines import LONGEST_H, fleet_lives, last_slope, mean_life, one_filter_a_component
from emaphm.study.fleet.clairvoyant import clairvoyant
from emaphm.study.fleet.drawn import EXACT, drawn_evidence
from emaphm.study.fleet.informed import informed
from emaphm.study.fleet.tracks import track

SHARES = (0.0, 0.25, 0.5, 0.75)
"""λ: of the way from the first check flight to the failure."""

ALPHA, BETA = 0.2, 0.5
"""Of alpha-lambda: half the width of the band, and the least probability within it."""

WITH_FLEET, WITH_LARGER, ALONE, CLAIRVOYANT, LAW_AND_LEVEL, INFORMED, LINE, FILTER, MEAN, LIVES = (
    "ours, with the fleet's prior",
    "ours, with a larger fleet's",
    "ours, general prior",
    "clairvoyant: law, parameters, level",
    "clairvoyant: law and level",
    "Bayes' rule, population known",
    "last slope",
    "one filter a component",
    "mean life of the fleet",
    "lives of the fleet",
)
WAYS = (WITH_FLEET, WITH_LARGER, ALONE, CLAIRVOYANT, LAW_AND_LEVEL, INFORMED, FILTER, LINE, MEAN, LIVES)

TRACKED = replace(FORECAST, paths=300)
"""Forecasts at every check flight: a risk of 5 % is then right to 1.3 %."""


@dataclass(frozen=True, eq=False)
class FailedUnit:
    """A unit that failed, its diagnoses, and what is known of the others: prior, and hours of failure.

    `larger` is the prior of a larger fleet, where there is one.
    """

    unit: SyntheticUnit
    evidence: Evidence
    prior: Prior
    lives: Sequence[float]
    larger: Prior | None = None


def judged(
    case: FailedUnit, plan: FleetPlan, actuator: Actuator, seed: int, *, tracked: bool = True
) -> dict[str, Any]:
    """Return the scores of each way at each share of life; if `tracked`, what it says at every check flight.

    Raises
    ------
    PrognosisError, MethodError
        Nothing can be predicted.
    """
    hours = [one.hours for one in case.evidence.used]
    failure = float(case.unit.failure or np.inf)
    chosen = [at_share_of_life(hours, failure, share) for share in SHARES]
    at = list(range(len(hours))) if tracked else chosen
    ways: dict[str, dict[str, Any]] = {}
    tracks: dict[str, dict[str, Any]] = {}
    for name, prior in ((WITH_FLEET, case.prior), (WITH_LARGER, case.larger), (ALONE, Prior())):
        if prior is None:
            continue
        past = follow(case.evidence, prior, seed=seed).past
        ways[name] = _scored(lives([past[i] for i in chosen], case.evidence, actuator), failure)
        if tracked:
            every = lives(past, case.evidence, actuator, settings=TRACKED)
            tracks[name] = track(every, failure, plan.interval)
    for name, said in _others(case, plan, actuator, at, seed).items():
        found = {i: (float(hours[i]), one) for i, one in zip(at, said, strict=True)}
        ways[name] = _scored([found[i] for i in chosen], failure)
        if tracked:
            tracks[name] = track(list(found.values()), failure, plan.interval)
    return {
        "unit": case.unit.serial_number,
        "failure": failure,
        "failed": case.unit.failed,
        "law": next(one.law for one in case.unit.components if one.name == case.unit.failed),
        "diagnoses": len(case.evidence.observations),
        "explained": len(hours),
        "ways": ways,
        "tracks": tracks,
    }


def _others(
    case: FailedUnit, plan: FleetPlan, actuator: Actuator, at: list[int], seed: int
) -> dict[str, list[Array]]:
    """Return the samples of the RUL [h] of each way but ours, at the explained diagnoses numbered `at`."""
    until = [_until(case.evidence, i) for i in at]
    return {
        CLAIRVOYANT: [clairvoyant(case.unit, one.hours, plan) for one in until],
        LAW_AND_LEVEL: _knowing_law_and_level(case.unit, plan, np.array([one.hours for one in until])),
        INFORMED: informed(case.evidence, plan, at),
        FILTER: [one_filter_a_component(one, actuator, seed) for one in until],
        LINE: [last_slope(one, actuator) for one in until],
        MEAN: [mean_life(one.hours, case.lives) for one in until],
        LIVES: [fleet_lives(one.hours, case.lives) for one in until],
    }


def _knowing_law_and_level(unit: SyntheticUnit, plan: FleetPlan, hours: Array) -> list[Array]:
    """Return samples of the RUL [h] at increasing `hours` by the laws, and the levels at check flights."""
    laws = {one.name: one.law for one in unit.components}
    at = np.searchsorted(unit.check_flights(plan.interval), hours)
    return informed(drawn_evidence(unit, plan, EXACT), plan, at.tolist(), laws)


def _until(evidence: Evidence, last: int) -> Evidence:
    """Return what was known at the explained diagnosis number `last`."""
    used = evidence.used[: last + 1]
    return Evidence(evidence.unit, evidence.part_number, used[-1].hours, used)


def _scored(said: Sequence[tuple[float, Array]], failure: float) -> dict[str, dict[str, Any]]:
    """Return what is counted of pairs of hours and sample of the RUL [h] at each of `SHARES`, by share."""
    predictions = [Prediction(*one) for one in said]
    return {
        str(share): {
            **_scores(one, failure),
            "good": alpha_lambda(predictions, failure, share, alpha=ALPHA, beta=BETA),
        }
        for share, one in zip(SHARES, predictions, strict=True)
    }


def _scores(one: Prediction, failure: float) -> dict[str, Any]:
    """Return what is counted of one prediction; a RUL beyond what is looked at counts as `LONGEST_H`."""
    true = failure - one.hours
    return {
        "hours": one.hours,
        "true": true,
        "median": min(one.median, LONGEST_H),
        "low": min(one.quantile(0.05), LONGEST_H),
        "high": min(one.quantile(0.95), LONGEST_H),
        "transform": probability_integral_transform(one, true),
        "crps": crps(one.sample, true, longest=LONGEST_H),
        "certain": one.sample.size == 1,
    }
