"""Readings of a health indicator over the hours of a unit, and their observations for the filter."""

import math
from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.errors import PrognosisError
from emaphm.prognosis.evidence import Evidence, Observation
from emaphm.prognosis.stress import StressPiece

FAILING = 0.5
"""Level of the filter at which the indicator fails; 0 is healthy. Levels end at 1, so that a level beyond the
limit can be represented."""


@dataclass(frozen=True)
class Reading:
    """The `value` of an indicator at flight `hours` [h], with the `variance` of its error.

    The variance includes all differences between readings at the same health: noise, and also variations
    from day to day.

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
        Serial number or name of the unit.
    healthy
        Value of a new unit.
    fails_at
        Value at which the unit fails; above or below the healthy value.
    readings
        Readings in any order.
    hours
        Present flight hours of the unit [h], not below those of its readings.
    measures
        Name of the measured quantity, with its unit, for figures and text.
    stresses
        Recorded stress of the unit.

    Raises
    ------
    PrognosisError
        `healthy` and `fails_at` are not finite, or differ by no more than a reading's standard error; a
        reading is later than `hours`; or `hours` are below 0.
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
        error = math.sqrt(min((reading.variance for reading in self.readings), default=0.0))
        if abs(self.fails_at - self.healthy) <= error:
            raise PrognosisError(
                f"unit '{self.unit}': healthy at {self.healthy:g} and failing at {self.fails_at:g} differ "
                f"by no more than a reading's standard error, {error:.2g}; give another value to fail at"
            )
        late = [reading.hours for reading in self.readings if reading.hours > self.hours]
        if late:
            raise PrognosisError(
                f"unit '{self.unit}' has {self.hours:.9g} h, and a reading at {late[0]:.9g} h; give the "
                "present hours"
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
                reading.hours,
                np.array([float(self.level(reading.value))]),
                np.array([[reading.variance * scale**2]]),
                np.ones(1, bool),
            )
            for reading in sorted(self.readings, key=lambda reading: reading.hours)
        )
        return Evidence(
            self.unit, self.measures, self.hours, observations, stresses=self.stresses, components=1
        )
