"""Outcome of removals by a prediction method over a fleet, and scores of the predictions over whole lives."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from emaphm.prognosis.metrics import brier, false_alarms_per_1000_hours, wasted_life
from emaphm.study.fleet.judging import MEAN, WAYS
from emaphm.study.fleet.tracks import COSTS, HORIZON_H, column

Units = Sequence[Mapping[str, Any]]


@dataclass(frozen=True)
class PolicyOutcome:
    """Outcome for a fleet whose units are removed by a prediction method and a rule, or not at all.

    Attributes
    ----------
    failed
        Share of the units that fail in service.
    wasted
        Mean share of life that remains at the removal; 0 for units that fail.
    unneeded
        Removals with more than `HORIZON_H` of true RUL, per 1,000 flight hours.
    cost
        Cost per 1,000 flight hours, in planned replacements: one per unit, or ten for a failure.
    """

    failed: float
    wasted: float
    unneeded: float
    cost: float

    @property
    def row(self) -> tuple[str, ...]:
        """The cells of a table."""
        return (
            f"{100 * self.failed:.0f} %",
            f"{100 * self.wasted:.0f} %",
            f"{self.unneeded:.2f}",
            f"{self.cost:.2f}",
        )


ACTING_HEADER = ("by the prediction of", "fail in service", "of life wasted", "unneeded removals", "cost")


def acted(units: Units, way: str, rule: str) -> PolicyOutcome:
    """Return the outcome of removing `units` (results of `judged`) by the method `way` and a `rule`."""
    removed = [unit["tracks"][way]["removed"][rule] for unit in units]
    return outcome(removed, [unit["failure"] for unit in units])


def outcome(removed: Sequence[float | None], failures: Sequence[float]) -> PolicyOutcome:
    """Return the outcome of removals at the hours `removed` (n,) [h], None for units that fail.

    `failures` (n,) [h] are the hours at which the units would fail.
    """
    end = np.array(failures)
    at = np.array([end[i] if hours is None else hours for i, hours in enumerate(removed)])
    failed = np.array([hours is None for hours in removed])
    paid = np.where(failed, COSTS.failure, COSTS.replacement)
    planned = list(zip(at[~failed], (end - at)[~failed], strict=True))
    return PolicyOutcome(
        failed=float(np.mean(failed)),
        wasted=wasted_life(at, end),
        unneeded=false_alarms_per_1000_hours(planned, float(at.sum()), HORIZON_H),
        cost=float(1000 * paid.sum() / at.sum()),
    )


def acted_rows(units: Units, rule: str) -> list[tuple[str, ...]]:
    """Return the rows of a table with `ACTING_HEADER`: one per method with a distribution, and no removal."""
    rows = [(way, *acted(units, way, rule).row) for way in tracked_ways(units) if way != MEAN]
    none = outcome([None] * len(units), [unit["failure"] for unit in units])
    return [*rows, ("no removal", *none.row)]


@dataclass(frozen=True)
class OverLife:
    """Scores of one prediction method at all check flights of all units.

    Attributes
    ----------
    brier
        Brier score of "fails within `HORIZON_H`", all check flights together.
    late
        Share of the predictions whose median exceeds the true RUL by more than 20 %, mean over the units.
    first, lasting
        Prognostic horizon (α 0.2, β 0.5), first met and met from then on, as a share of life, mean over the
        units.
    accuracy
        Cumulative relative accuracy, median over the units.
    """

    brier: float
    late: float
    first: float
    lasting: float
    accuracy: float

    @property
    def row(self) -> tuple[str, ...]:
        """The cells of a table."""
        return (
            f"{self.brier:.3f}",
            f"{100 * self.late:.0f} %",
            f"{100 * self.first:.0f} %",
            f"{100 * self.lasting:.0f} %",
            f"{self.accuracy:.2f}",
        )


OVER_LIFE_HEADER = (
    "prediction",
    f"Brier score, {HORIZON_H:g} h",
    "late",
    "prognostic horizon, first met",
    "met from then on",
    "cumulative relative accuracy",
)


def over_life(units: Units, way: str) -> OverLife:
    """Return the scores of a prediction method `way` over the lives of `units` (results of `judged`)."""
    tracks = [unit["tracks"][way] for unit in units]
    failures = np.array([unit["failure"] for unit in units])
    true = np.concatenate([end - column(track, "hours") for track, end in zip(tracks, failures, strict=True)])
    horizons = np.array([track["horizon"] for track in tracks]) / failures[:, np.newaxis]
    return OverLife(
        brier=brier(np.concatenate([column(track, "probability") for track in tracks]), true <= HORIZON_H),
        late=float(np.mean([track["late"] for track in tracks])),
        first=float(np.mean(horizons[:, 0])),
        lasting=float(np.mean(horizons[:, 1])),
        accuracy=float(np.median([track["accuracy"] for track in tracks])),
    )


def over_life_rows(units: Units) -> list[tuple[str, ...]]:
    """Return the rows of a table with `OVER_LIFE_HEADER`, one per prediction method."""
    return [(way, *over_life(units, way).row) for way in tracked_ways(units)]


def tracked_ways(units: Units) -> tuple[str, ...]:
    """Return the prediction methods with predictions at all check flights of `units`, one or more."""
    return tuple(way for way in WAYS if way in units[0]["tracks"])
