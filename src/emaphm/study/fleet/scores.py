"""The table of the study: what each way of predicting scores at each share of life."""

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
    """Of one way of predicting at one share of life, over n units.

    Attributes
    ----------
    alpha_lambda
        Share of the units of which half of the probability is within ±20 % of the true RUL.
    coverage
        Share whose true RUL is within the central 90 % interval; None of predictions without one.
    crps
        Mean [h].
    late
        Share whose median exceeds the true RUL by more than 20 %.
    error
        Median over the units of |median - true| / true.
    width
        Median over the units of the 90 % interval's width, as a share of the true RUL; None without one.
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
    """Return the scores of a way of predicting over `units`, one or more, as `judged` gives them."""
    found = [one["ways"][way][str(share)] for one in units]
    true = np.array([one["true"] for one in found])
    median = np.array([one["median"] for one in found])
    certain = all(one["certain"] for one in found)
    width = np.array([one["high"] - one["low"] for one in found]) / true
    return Scores(
        units=len(found),
        alpha_lambda=float(np.mean([one["good"] for one in found])),
        coverage=None if certain else coverage([one["transform"] for one in found]),
        crps=float(np.mean([one["crps"] for one in found])),
        late=float(np.mean(median > (1 + LATE) * true)),
        error=float(np.median(np.abs(median - true) / true)),
        width=None if certain else float(np.median(width)),
    )


def alpha_lambda_interval(score: Scores) -> tuple[float, float]:
    """Return the 90 % interval (Wilson 1927) of an alpha-lambda, as a share of all units of such a fleet."""
    n, p, z = score.units, score.alpha_lambda, 1.645
    centre, half = p + z**2 / (2 * n), z * np.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    return float((centre - half) / (1 + z**2 / n)), float((centre + half) / (1 + z**2 / n))


def warnings(units: Sequence[Mapping[str, Any]], way: str) -> list[float]:
    """Return the share of life [-] that remained at each unit's first warning by a `way`, 0 without one.

    The first check flight at which its probability of failure within `HORIZON_H` exceeds `RISK`.
    """
    left = []
    for one in units:
        of_way = one["tracks"][way]
        warned = column(of_way, "hours")[column(of_way, "probability") > RISK]
        left.append(1 - warned[0] / one["failure"] if warned.size else 0.0)
    return left


def ways(units: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    """Return the ways in which units, one or more, were predicted."""
    return tuple(way for way in WAYS if way in units[0]["ways"])
