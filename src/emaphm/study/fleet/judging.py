"""Evaluation of each prediction method for a synthetic unit over its life, against its true failure."""

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
from emaphm.prognosis.prognose import rul_forecasts
from emaphm.prognosis.settings import FORECAST
from emaphm.study.fleet.baselines import LONGEST_H, fleet_lives, last_slope, mean_life, one_filter_a_component
from emaphm.study.fleet.clairvoyant import clairvoyant
from emaphm.study.fleet.drawn import EXACT, drawn_evidence
from emaphm.study.fleet.informed import informed
from emaphm.study.fleet.tracks import track

SHARES = (0.0, 0.25, 0.5, 0.75)
"""λ: shares of the time from the first check flight to the failure."""

ALPHA, BETA = 0.2, 0.5
"""Parameters of alpha-lambda: half-width of the band, and the least probability within it."""

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
"""Settings of the forecasts at every check flight: the standard error of a risk of 5 % is 1.3 %."""


@dataclass(frozen=True, eq=False)
class FailedUnit:
    """A failed unit, its diagnoses, the prior from the other units of the fleet, and their hours of failure.

    `larger` is the prior from a larger fleet, if there is one.
    """

    unit: SyntheticUnit
    evidence: Evidence
    prior: Prior
    lives: Sequence[float]
    larger: Prior | None = None


def judged(
    case: FailedUnit, plan: FleetPlan, actuator: Actuator, seed: int, *, tracked: bool = True
) -> dict[str, Any]:
    """Return the scores of each method at each share of life and, if `tracked`, over all check flights.

    Raises
    ------
    PrognosisError, MethodError
        The diagnoses do not permit a prediction.
    """
    hours = [diagnosis.hours for diagnosis in case.evidence.used]
    failure = float(case.unit.failure or np.inf)
    chosen = [at_share_of_life(hours, failure, share) for share in SHARES]
    at = list(range(len(hours))) if tracked else chosen
    ways: dict[str, dict[str, Any]] = {}
    tracks: dict[str, dict[str, Any]] = {}
    for name, prior in ((WITH_FLEET, case.prior), (WITH_LARGER, case.larger), (ALONE, Prior())):
        if prior is None:
            continue
        past = follow(case.evidence, prior, seed=seed).past
        ways[name] = _scored(rul_forecasts([past[i] for i in chosen], case.evidence, actuator), failure)
        if tracked:
            at_all_flights = rul_forecasts(past, case.evidence, actuator, settings=TRACKED)
            tracks[name] = track(at_all_flights, failure, plan.interval)
    for name, samples in _reference_samples(case, plan, actuator, at, seed).items():
        predicted = {i: (float(hours[i]), sample) for i, sample in zip(at, samples, strict=True)}
        ways[name] = _scored([predicted[i] for i in chosen], failure)
        if tracked:
            tracks[name] = track(list(predicted.values()), failure, plan.interval)
    return {
        "unit": case.unit.serial_number,
        "failure": failure,
        "failed": case.unit.failed,
        "law": next(
            component.law for component in case.unit.components if component.name == case.unit.failed
        ),
        "diagnoses": len(case.evidence.observations),
        "explained": len(hours),
        "ways": ways,
        "tracks": tracks,
    }


def _reference_samples(
    case: FailedUnit, plan: FleetPlan, actuator: Actuator, at: list[int], seed: int
) -> dict[str, list[Array]]:
    """Return samples of the RUL [h] of the reference methods, at the explained diagnoses numbered `at`."""
    past = [_evidence_until(case.evidence, i) for i in at]
    return {
        CLAIRVOYANT: [clairvoyant(case.unit, known.hours, plan) for known in past],
        LAW_AND_LEVEL: _from_law_and_level(case.unit, plan, np.array([known.hours for known in past])),
        INFORMED: informed(case.evidence, plan, at),
        FILTER: [one_filter_a_component(known, actuator, seed) for known in past],
        LINE: [last_slope(known, actuator) for known in past],
        MEAN: [mean_life(known.hours, case.lives) for known in past],
        LIVES: [fleet_lives(known.hours, case.lives) for known in past],
    }


def _from_law_and_level(unit: SyntheticUnit, plan: FleetPlan, hours: Array) -> list[Array]:
    """Return samples of the RUL [h] at increasing `hours` from the true laws and the true past levels."""
    laws = {component.name: component.law for component in unit.components}
    at = np.searchsorted(unit.check_flights(plan.interval), hours)
    return informed(drawn_evidence(unit, plan, EXACT), plan, at.tolist(), laws)


def _evidence_until(evidence: Evidence, last: int) -> Evidence:
    """Return the evidence up to the explained diagnosis number `last`."""
    used = evidence.used[: last + 1]
    return Evidence(evidence.unit, evidence.part_number, used[-1].hours, used)


def _scored(samples: Sequence[tuple[float, Array]], failure: float) -> dict[str, dict[str, Any]]:
    """Return the scores of predictions at each of `SHARES`, by share.

    `samples` are pairs of flight hours and sample of the RUL [h], one per share.
    """
    predictions = [Prediction(*pair) for pair in samples]
    return {
        str(share): {
            **_scores(prediction, failure),
            "good": alpha_lambda(predictions, failure, share, alpha=ALPHA, beta=BETA),
        }
        for share, prediction in zip(SHARES, predictions, strict=True)
    }


def _scores(prediction: Prediction, failure: float) -> dict[str, Any]:
    """Return the scores of one prediction; a RUL above `LONGEST_H` counts as `LONGEST_H`."""
    true = failure - prediction.hours
    return {
        "hours": prediction.hours,
        "true": true,
        "median": min(prediction.median, LONGEST_H),
        "low": min(prediction.quantile(0.05), LONGEST_H),
        "high": min(prediction.quantile(0.95), LONGEST_H),
        "transform": probability_integral_transform(prediction, true),
        "crps": crps(prediction.sample, true, longest=LONGEST_H),
        "certain": prediction.sample.size == 1,
    }
