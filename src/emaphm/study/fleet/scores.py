"""Scores of each prediction method at each share of life, for the tables of the study."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from emaphm.prognosis.metrics import coverage
from emaphm.study.fleet.judging import WAYS
from emaphm.study.fleet.tracks import LATE, RISK, column

HEADER = (
    "prediction",
    "alpha-lambda",
    "coverage of 90 %",
    "CRPS, h",
    "late",
    "error of the median",
    "width of 90 %",
)


@dataclass(frozen=True)
class Scores:
    """Scores of one prediction method at one share of life, over `units` units.

    Attributes
    ----------
    alpha_lambda
        Share of the units with at least half of the probability within ±20 % of the true RUL.
    coverage
        Share of the units with the true RUL within the central 90 % interval; None without intervals.
    crps
        Mean continuous ranked probability score [h].
    late
        Share of the units whose median exceeds the true RUL by more than 20 %.
    error
        Median over the units of |median - true| / true.
    width
        Median over the units of the width of the 90 % interval, relative to the true RUL; None without
        intervals.
    """

    units: int
    alpha_lambda: float
    coverage: float | None
    crps: float
    late: float
    error: float
    width: float | None

    @property
    def row(self) -> tuple[str, ...]:
        """The cells of a table."""
        return (
            f"{self.alpha_lambda:.2f}",
            "–" if self.coverage is None else f"{100 * self.coverage:.0f} %",
            f"{self.crps:,.0f}",
            f"{100 * self.late:.0f} %",
            f"{100 * self.error:.0f} %",
            "–" if self.width is None else f"{self.width:.2f}",
        )


def scores(units: Sequence[Mapping[str, Any]], way: str, share: float) -> Scores:
    """Return the scores of a prediction method `way` over `units`, one or more results of `judged`."""
    predictions = [unit["ways"][way][str(share)] for unit in units]
    true = np.array([prediction["true"] for prediction in predictions])
    median = np.array([prediction["median"] for prediction in predictions])
    certain = all(prediction["certain"] for prediction in predictions)
    width = np.array([prediction["high"] - prediction["low"] for prediction in predictions]) / true
    return Scores(
        units=len(predictions),
        alpha_lambda=float(np.mean([prediction["good"] for prediction in predictions])),
        coverage=None if certain else coverage([prediction["transform"] for prediction in predictions]),
        crps=float(np.mean([prediction["crps"] for prediction in predictions])),
        late=float(np.mean(median > (1 + LATE) * true)),
        error=float(np.median(np.abs(median - true) / true)),
        width=None if certain else float(np.median(width)),
    )


def alpha_lambda_interval(score: Scores) -> tuple[float, float]:
    """Return the 90 % interval (Wilson 1927) of an alpha-lambda, for the population of the fleet."""
    n, p, z = score.units, score.alpha_lambda, 1.645
    centre, half = p + z**2 / (2 * n), z * np.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    return float((centre - half) / (1 + z**2 / n)), float((centre + half) / (1 + z**2 / n))


def warnings(units: Sequence[Mapping[str, Any]], way: str) -> list[float]:
    """Return the share of life [-] that remains at the first warning of each unit by a method `way`, or 0.

    The first warning is at the first check flight whose probability of failure within `HORIZON_H` exceeds
    `RISK`.
    """
    remaining = []
    for unit in units:
        track = unit["tracks"][way]
        warned = column(track, "hours")[column(track, "probability") > RISK]
        remaining.append(1 - warned[0] / unit["failure"] if warned.size else 0.0)
    return remaining


def ways(units: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    """Return the prediction methods of `units`, one or more."""
    return tuple(way for way in WAYS if way in units[0]["ways"])
