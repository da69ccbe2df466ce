"""A health indicator over the hours of a unit, and as what the degradation filter sees it."""

import math
from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.errors import PrognosisError
from emaphm.prognosis.evidence import Evidence, Observation
from emaphm.prognosis.stress import StressPiece

FAILING = 0.5
"""Level of the filter at which the indicator fails, 0 being healthy: levels end at 1, and one beyond its
limit must be seen to be so."""


@dataclass(frozen=True)
class Reading:
    """The `value` of an indicator at flight `hours` [h], with the `variance` of its error.

    The variance is that of all that makes two readings of the same health differ: noise, but also what
    varies from one day to the next.

    Raises
    ------
    PrognosisError
        A number is not finite, hours are below 0, or the variance is not above 0.
    """

    hours: float
    value: float
    variance: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.hours) and self.hours >= 0 and math.isfinite(self.value)):
            raise PrognosisError(
                f"a reading of {self.value:g} at {self.hours:.9g} h: give finite numbers, hours of 0 or more"
            )
        if not (math.isfinite(self.variance) and self.variance > 0):
            raise PrognosisError(
                f"the reading at {self.hours:.9g} h has the variance {self.variance:g}: give a number above 0"
            )


@dataclass(frozen=True)
class Indicator:
    """A health indicator of a unit that has flown `hours` [h]: any number, rising or falling to its limit.

    Parameters
    ----------
    unit
        Serial number, or what the unit is called.
    healthy
        Value of a new unit.
    fails_at
        Value at which the unit no longer does its job; above or below the healthy one.
    readings
        In any order.
    hours
        Flight hours of the unit now [h], not below those of its readings.
    measures
        What the value is, with its unit, for figures and text.
    stresses
        What the unit was subject to, where that was recorded.

    Raises
    ------
    PrognosisError
        `healthy` and `fails_at` are not finite, or no further apart than a reading's standard error; a
        reading is later than `hours`; or these are below 0.
    """

    unit: str
    healthy: float
    fails_at: float
    readings: tuple[Reading, ...]
    hours: float
    measures: str = "indicator"
    stresses: tuple[StressPiece, ...] = ()

    def __post_init__(self) -> None:
        if not (math.isfinite(self.healthy) and math.isfinite(self.fails_at)):
            raise PrognosisError(
                f"unit '{self.unit}': healthy at {self.healthy:g}, failing at {self.fails_at:g}; "
                "give finite numbers"
            )
        error = math.sqrt(min((one.variance for one in self.readings), default=0.0))
        if abs(self.fails_at - self.healthy) <= error:
            raise PrognosisError(
                f"unit '{self.unit}': healthy at {self.healthy:g} and failing at {self.fails_at:g} are no "
                f"further apart than a reading's standard error, {error:.2g}; give another level to fail at"
            )
        late = [one.hours for one in self.readings if one.hours > self.hours]
        if late:
            raise PrognosisError(
                f"unit '{self.unit}' has {self.hours:.9g} h, and a reading at {late[0]:.9g} h; give the "
                "hours of now"
            )
        if not 0 <= self.hours < math.inf:
            raise PrognosisError(f"unit '{self.unit}' has {self.hours:.9g} h; give a number of 0 or more")

    def level(self, value: Array | float) -> Array:
        """Return values as levels of the filter, 0 healthy and `FAILING` at the limit."""
        return FAILING * (np.asarray(value) - self.healthy) / (self.fails_at - self.healthy)

    def value(self, level: Array | float) -> Array:
        """Return levels of the filter as values."""
        return self.healthy + np.asarray(level) / FAILING * (self.fails_at - self.healthy)

    def evidence(self) -> Evidence:
        """Return the readings as observations of one component."""
        scale = FAILING / (self.fails_at - self.healthy)
        observations = tuple(
            Observation(
                one.hours,
                np.array([float(self.level(one.value))]),
                np.array([[one.variance * scale**2]]),
                np.ones(1, bool),
            )
            for one in sorted(self.readings, key=lambda one: one.hours)
        )
        return Evidence(
            self.unit, self.measures, self.hours, observations, stresses=self.stresses, components=1
        )
