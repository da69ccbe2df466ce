"""Missions of a fleet's units: how their stress varies, and random future stress.

The stress covariates z of a recorded interval (`emaphm.prognosis.stress`) are normal about those of the
unit's mission, and missions are normal about the reference stress:

    m ~ N(0, W / k),    z ~ N(m, W) for each interval,
    m ~ N(n x / (n + k), W / (n + k)) given n recorded intervals of mean x.

W is the variance of a covariate between the intervals of a unit, and W / k that between units. The covariates
are independent of each other. A unit ages unevenly in future intervals, and its mission is not known exactly:
a forecast with the mean stress alone has too narrow intervals.
"""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from emaphm.arrays import Array
from emaphm.prognosis.stress import (
    AT_REFERENCE,
    NO_FLIGHTS,
    Stress,
    StressPiece,
    StressReference,
    exposure,
)

FEWEST_UNITS, MOST_FLIGHTS = 5, 100.0
"""Least number of units from which the differences between missions are estimated, and the largest weight of
the reference, in intervals."""

LEAST_VARIANCE = 1e-12
"""Variance of a covariate between the intervals of a unit below which it is constant: the rest is rounding
error."""

INTERVALS = 100
"""Number of future intervals that are drawn; the mean of these continues afterwards."""


class Missions(NamedTuple):
    """Variation of the stress of a fleet, each (3,), by covariate; 0 where it is not known.

    Attributes
    ----------
    reference_weight
        k, the weight of the reference in the mission of a unit, in recorded intervals.
    variance
        W, the variance of a covariate between the intervals of a unit.
    hours
        Median length of a recorded interval [h].
    """

    reference_weight: tuple[float, ...] = NO_FLIGHTS
    variance: tuple[float, ...] = NO_FLIGHTS
    hours: float = 1.0

    @classmethod
    def of(cls, units: Sequence[Sequence[StressPiece]], reference: StressReference) -> Self:
        """Return the variation of the recorded stress of `units` by analysis of variance.

        Values have one digit, the hours two, so that a further flight seldom changes a prior. A covariate
        needs at least five units with two recorded intervals. With the weight k, the mean of a unit's
        intervals becomes the best linear prediction of its mission.
        """
        recorded = [
            [(one.stress.values, reference.covariates(one.stress)) for one in pieces] for pieces in units
        ]
        by_covariate = [
            _variation([np.array([z[i] for values, z in of if values[i] is not None]) for of in recorded])
            for i in range(len(NO_FLIGHTS))
        ]
        weight, variance = zip(*by_covariate, strict=True)
        lengths = [one.end - one.start for pieces in units for one in pieces]
        return cls(weight, variance, float(f"{np.median(lengths):.2g}") if lengths else 1.0)


UNKNOWN = Missions()
"""No variation, if no stress was recorded or there is no fleet: the mean of a unit's intervals continues."""


class FutureStress(NamedTuple):
    """Random stress of future intervals of `hours` [h] each: covariates (n, m, 3) of n paths, m intervals."""

    covariates: Array
    hours: float

    @classmethod
    def drawn(
        cls,
        missions: Missions,
        pieces: Sequence[StressPiece],
        reference: StressReference | None,
        hours: float,
        ahead: Stress | None,
        count: int,
        random: np.random.Generator,
    ) -> Self:
        """Return `count` paths of the stress after flight `hours` [h] of a unit that has flown `pieces`.

        Covariates that `ahead` gives have its values in all intervals. The mission of a covariate that the
        unit has never recorded is not drawn: it is a part of the unit's own pace.
        """
        if reference is None:
            return cls(np.zeros((count, 1, len(NO_FLIGHTS))), missions.hours)
        flown = exposure(pieces, reference, 0.0, hours) if hours > 0 else AT_REFERENCE
        weight, variance = np.array(missions.reference_weight), np.array(missions.variance)
        recorded = np.sum(
            [[x is not None for x in piece.stress.values] for piece in pieces if piece.start < hours],
            axis=0,
        )
        number = np.maximum(recorded + weight, 1e-9)
        deviation = np.where(recorded > 0, np.sqrt(variance / number), 0.0)
        own = flown.mean * (recorded / number)
        mission = own + deviation * random.standard_normal((count, 1, len(weight)))
        covariates = mission + np.sqrt(variance) * random.standard_normal((count, INTERVALS, len(weight)))
        if ahead is not None:
            covariates = np.where(reference.stated(ahead), reference.covariates(ahead), covariates)
        return cls(covariates, missions.hours)

    def flight_hours(self, ageing: Array, exponents: Array) -> Array:
        """Return the flight hours (n,) [h] in which a component ages by `ageing` (n,) [h].

        `exponents` (3,) are those of the component. Infinite hours of ageing remain infinite.
        """
        rates = np.exp(self.covariates @ exponents)
        aged = np.cumsum(rates, axis=1) * self.hours
        complete = np.sum(aged <= ageing[:, np.newaxis], axis=1)
        paths = np.arange(ageing.size)
        before = np.concatenate([np.zeros((ageing.size, 1)), aged], axis=1)[paths, complete]
        rate = np.concatenate([rates, rates.mean(axis=1, keepdims=True)], axis=1)[paths, complete]
        return np.asarray(self.hours * complete + (ageing - before) / rate)


def _variation(units: Sequence[Array]) -> tuple[float, float]:
    """Return k and W of one covariate, from its values in the recorded intervals (n,) of each unit."""
    several = [values for values in units if values.size > 1]
    if len(several) < FEWEST_UNITS:
        return 0.0, 0.0
    counts = np.array([values.size for values in several])
    within = sum(values.size * values.var() for values in several) / (counts - 1).sum()
    if within <= LEAST_VARIANCE:
        return 0.0, 0.0
    between = np.var([values.mean() for values in several], ddof=1) - within * np.mean(1 / counts)
    return float(f"{within / max(between, within / MOST_FLIGHTS):.1g}"), float(f"{within:.1g}")
