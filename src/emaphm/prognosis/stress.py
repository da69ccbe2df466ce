"""Stress of a unit: load, temperature and cycles, which change the rate of ageing of its components."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator.quantity import COLDEST, HOTTEST
from emaphm.arrays import Array
from emaphm.errors import PrognosisError

STRESSES = ("load", "temperature", "cycles")
"""Stress covariates, in the order of all arrays of them."""

STRESS_KEYS = ("load", "temperature_K", "cycles_per_hour")
"""JSON keys of the stress covariates."""

LARGEST_RATIO = 10.0
"""Largest ratio of a load or of cycles per hour to the reference, and its inverse: the model is not used
beyond."""

LARGEST_KELVINS = 50.0
"""Largest distance of a temperature from its reference [K]."""

TEN_KELVINS = 10.0
"""Unit of the temperature covariate [K]."""

NO_FLIGHTS = (0.0, 0.0, 0.0)
"""Weight of the reference in a unit's future stress without a fleet."""


@dataclass(frozen=True)
class Stress:
    """Mean stress of a unit over some hours; unknown values are None.

    Parameters
    ----------
    load
        Mean size of the load [N·m; N of a linear actuator].
    temperature
        Mean temperature [K].
    cycles_per_hour
        Cycles per flight hour [1/h].

    Raises
    ------
    PrognosisError
        A load or cycles are not a number of 0 or more, or a temperature is outside the range of actuators.
    """

    load: float | None = None
    temperature: float | None = None
    cycles_per_hour: float | None = None

    def __post_init__(self) -> None:
        for name, value in (("load", self.load), ("cycles per hour", self.cycles_per_hour)):
            if value is not None and not (math.isfinite(value) and value >= 0):
                raise PrognosisError(f"a stress of {name} {value:g}: give a number of 0 or more")
        if self.temperature is not None and not COLDEST <= self.temperature <= HOTTEST:
            raise PrognosisError(
                f"a temperature of {self.temperature:g} K: give kelvins, from {COLDEST:g} to {HOTTEST:g}"
            )

    @property
    def values(self) -> tuple[float | None, float | None, float | None]:
        """The three values, in the order of `STRESSES`."""
        return self.load, self.temperature, self.cycles_per_hour


class StressPiece(NamedTuple):
    """The `stress` of the hours from `start` to `end` [h]."""

    start: float
    end: float
    stress: Stress


@dataclass(frozen=True)
class StressReference:
    """The stress at which a component ages by an hour per hour; None for values that nobody recorded.

    With load L, temperature θ and cycles per hour c, a component ages by

        a = (L / L_0)^p · exp(b (θ - θ_0) / 10 K) · (c / c_0)^γ

    hours per hour (accelerated life [1]); each component has its own exponents p, b, γ. Values that were not
    recorded are assumed to be at the reference.

    References
    ----------
    [1] Nelson: Accelerated Testing (1990), chapters 2 and 10: life-stress relations, cumulative exposure.
    """

    load: float | None = None
    temperature: float | None = None
    cycles_per_hour: float | None = None

    @property
    def values(self) -> tuple[float | None, float | None, float | None]:
        """The three values, in the order of `STRESSES`."""
        return self.load, self.temperature, self.cycles_per_hour

    @classmethod
    def of(cls, pieces: Sequence[StressPiece]) -> Self | None:
        """Return the medians of the recorded values; None if nothing was recorded."""
        rows = [piece.stress.values for piece in pieces]
        known = [[x for x in column if x is not None] for column in zip(*rows, strict=True)]
        medians = [float(np.median(column)) if column else None for column in known]
        # A median of 0 cannot be a scale: most flights had no load, and the covariate is not informative.
        medians = [x or None for x in medians]
        return cls(*medians) if any(x is not None for x in medians) else None

    def rounded(self) -> "StressReference":
        """Return the reference with two digits, the temperature with three; its exact value does not matter.

        Medians change slightly with each flight, and a changed reference would change the prior from the
        fleet.
        """
        digits = (2, 3, 2)
        return StressReference(
            *(None if x is None else float(f"{x:.{n}g}") for x, n in zip(self.values, digits, strict=True))
        )

    def beyond(self, stress: Stress) -> list[str]:
        """Return a clause for each value of `stress` that is clipped as too far from the reference."""
        clauses = []
        for name, value, reference in zip(STRESSES, stress.values, self.values, strict=True):
            if value is None or reference is None:
                continue
            if name == "temperature" and abs(value - reference) > LARGEST_KELVINS:
                clauses.append(f"{name} is taken as {LARGEST_KELVINS:g} K from {reference:.4g} K")
            elif name != "temperature" and not 1 / LARGEST_RATIO <= value / reference <= LARGEST_RATIO:
                factor = LARGEST_RATIO if value > reference else 1 / LARGEST_RATIO
                clauses.append(f"{name} is taken as {factor:g} × {reference:.3g}")
        return clauses

    def stated(self, stress: Stress) -> NDArray[np.bool_]:
        """Return which covariates `stress` gives and the reference contains, shape (3,)."""
        return np.array([None not in pair for pair in zip(stress.values, self.values, strict=True)])

    def covariates(self, stress: Stress) -> Array:
        """Return ln(L / L_0), (θ - θ_0) / 10 K and ln(c / c_0), shape (3,)."""
        result = np.zeros(len(STRESSES))
        for i, (value, reference) in enumerate(zip(stress.values, self.values, strict=True)):
            if value is None or reference is None:
                continue
            if STRESSES[i] == "temperature":
                difference = min(max(value - reference, -LARGEST_KELVINS), LARGEST_KELVINS)
                result[i] = difference / TEN_KELVINS
            else:
                result[i] = math.log(min(max(value / reference, 1 / LARGEST_RATIO), LARGEST_RATIO))
        return result


class Exposure(NamedTuple):
    """Flight hours (m,) [h] and their stress covariates (m, 3)."""

    hours: Array
    covariates: Array

    @property
    def mean(self) -> Array:
        """Mean covariates, (3,)."""
        return np.asarray(self.hours @ self.covariates / self.hours.sum())

    def aged(self, exponents: Array) -> Array:
        """Return the hours [h] of ageing (…) for exponents β (…, 3) of components: Σ h exp(β·z)."""
        return np.asarray(np.exp(exponents @ self.covariates.T) @ self.hours)


AT_REFERENCE = Exposure(np.ones(1), np.zeros((1, len(STRESSES))))
"""One hour at the reference: exposure of a unit that has not flown."""


def recorded_within(
    pieces: Sequence[StressPiece], start: float, end: float
) -> Iterator[tuple[float, Stress]]:
    """Yield the recorded hours [h] from `start` to `end` [h], with their stress."""
    for piece in pieces:
        overlap = min(piece.end, end) - max(piece.start, start)
        if overlap > 0:
            yield overlap, piece.stress


def exposure(
    pieces: Sequence[StressPiece], reference: StressReference | None, start: float, end: float
) -> Exposure:
    """Return the exposure from `start` to `end` [h]; hours without a piece are at the reference."""
    hours, covariates, unrecorded = [], [], end - start
    if reference is not None:
        for recorded, stress in recorded_within(pieces, start, end):
            hours.append(recorded)
            covariates.append(reference.covariates(stress))
            unrecorded -= recorded
    # Rounding may make the remainder slightly negative.
    hours.append(max(unrecorded, 0.0))
    covariates.append(np.zeros(len(STRESSES)))
    return Exposure(np.array(hours), np.array(covariates))


def ageing_ahead(
    pieces: Sequence[StressPiece],
    reference: StressReference | None,
    hours: float,
    exponents: Array,
    ahead: Stress | None = None,
    weight_of_reference: Sequence[float] = NO_FLIGHTS,
) -> Array | float:
    """Return the hours (…) by which components with `exponents` (…, 3) age in a future hour.

    The ageing is the mean over the past, up to `hours` [h], with the covariates y that `ahead` gives:

        a = Σ h exp(β_x·(x - w x̄) + β_y·y) / Σ h,   x: other covariates of the h flown hours, of mean x̄

    A covariate continues as in the past if `ahead` leaves it out, or if it was never recorded. Its mean over
    n recorded intervals is shrunk towards the reference by w = k / (n + k), where k is its
    `weight_of_reference` in intervals (`Missions`): a few intervals determine a mission badly.
    """
    if reference is None:
        return 1.0
    flown = exposure(pieces, reference, 0.0, hours) if hours > 0 else AT_REFERENCE
    weight = np.array(weight_of_reference)
    share = weight / np.maximum(sum(piece.start < hours for piece in pieces) + weight, 1e-9)
    flown = Exposure(flown.hours, flown.covariates - share * flown.mean)
    if ahead is not None:
        flown = Exposure(
            flown.hours, np.where(reference.stated(ahead), reference.covariates(ahead), flown.covariates)
        )
    return np.asarray(flown.aged(exponents) / flown.hours.sum())


def stress_dict(reference: StressReference | None, ahead: Stress | None) -> dict[str, Any]:
    """Return as JSON the reference stress of the hours, and the future stress that was given."""
    return {
        "reference": None if reference is None else dict(zip(STRESS_KEYS, reference.values, strict=True)),
        "ahead": None if ahead is None else dict(zip(STRESS_KEYS, ahead.values, strict=True)),
    }
