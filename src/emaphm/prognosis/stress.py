"""How hard a unit works: load, temperature and cycles make its components age faster or slower."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np

from emaphm.actuator.quantity import COLDEST, HOTTEST
from emaphm.arrays import Array
from emaphm.errors import PrognosisError

STRESSES = ("load", "temperature", "cycles")
"""Stress covariates, in the order of all arrays of them."""

STRESS_KEYS = ("load", "temperature_K", "cycles_per_hour")
"""Their names in JSON."""

LARGEST_RATIO = 10.0
"""Of a load or of cycles per hour to their reference, and its inverse: beyond, no exponent would hold."""

LARGEST_KELVINS = 50.0
"""Of a temperature's distance from its reference."""

TEN_KELVINS = 10.0
"""Unit of the temperature covariate [K]."""


@dataclass(frozen=True)
class Stress:
    """What a unit was subject to on the mean of some hours; None what is not known.

    Parameters
    ----------
    load
        Mean size of the load [N·m; N of a linear actuator].
    temperature
        Mean temperature [K].
    cycles_per_hour
        [1/h].

    Raises
    ------
    PrognosisError
        A load or cycles are no number of 0 or more, or a temperature is none that an actuator has.
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
        """The three, in the order of `STRESSES`."""
        return self.load, self.temperature, self.cycles_per_hour


class StressPiece(NamedTuple):
    """The `stress` of the hours from `start` to `end` [h]."""

    start: float
    end: float
    stress: Stress


@dataclass(frozen=True)
class StressReference:
    """The stress at which an hour ages a component by an hour; None for what nobody recorded.

    With load L, temperature θ and cycles per hour c, it ages by

        a = (L / L_0)^p · exp(b (θ - θ_0) / 10 K) · (c / c_0)^γ

    hours an hour: an accelerated life, whose exponents p, b, γ each component has its own of [1]. What was
    not recorded is taken to be the reference.

    References
    ----------
    [1] Nelson: Accelerated Testing (1990), chapters 2 and 10: life-stress relations, cumulative exposure.
    """

    load: float | None = None
    temperature: float | None = None
    cycles_per_hour: float | None = None

    @property
    def values(self) -> tuple[float | None, float | None, float | None]:
        """The three, in the order of `STRESSES`."""
        return self.load, self.temperature, self.cycles_per_hour

    @classmethod
    def of(cls, pieces: Sequence[StressPiece]) -> Self | None:
        """Return the medians of what was recorded; None where nothing was."""
        rows = [piece.stress.values for piece in pieces]
        known = [[x for x in column if x is not None] for column in zip(*rows, strict=True)]
        medians = [float(np.median(column)) if column else None for column in known]
        # A median of 0 is no scale: most flights were without load, and the covariate says nothing.
        medians = [x or None for x in medians]
        return cls(*medians) if any(x is not None for x in medians) else None

    def rounded(self) -> "StressReference":
        """Return the reference with two digits, the temperature with three: any scale close to it will do.

        Medians change a little with each flight, and with the reference the whole prior from the fleet.
        """
        digits = (2, 3, 2)
        return StressReference(
            *(None if x is None else float(f"{x:.{n}g}") for x, n in zip(self.values, digits, strict=True))
        )

    def beyond(self, stress: Stress) -> list[str]:
        """Return what of a stress is farther from the reference than it is used, a clause each."""
        found = []
        for name, value, middle in zip(STRESSES, stress.values, self.values, strict=True):
            if value is None or middle is None:
                continue
            if name == "temperature" and abs(value - middle) > LARGEST_KELVINS:
                found.append(f"{name} is taken as {LARGEST_KELVINS:g} K from {middle:.4g} K")
            elif name != "temperature" and not 1 / LARGEST_RATIO <= value / middle <= LARGEST_RATIO:
                factor = LARGEST_RATIO if value > middle else 1 / LARGEST_RATIO
                found.append(f"{name} is taken as {factor:g} × {middle:.3g}")
        return found

    def covariates(self, stress: Stress) -> Array:
        """Return ln(L / L_0), (θ - θ_0) / 10 K and ln(c / c_0), shape (3,)."""
        result = np.zeros(len(STRESSES))
        for i, (value, middle) in enumerate(zip(stress.values, self.values, strict=True)):
            if value is None or middle is None:
                continue
            if STRESSES[i] == "temperature":
                kelvins = min(max(value - middle, -LARGEST_KELVINS), LARGEST_KELVINS)
                result[i] = kelvins / TEN_KELVINS
            else:
                result[i] = math.log(min(max(value / middle, 1 / LARGEST_RATIO), LARGEST_RATIO))
        return result


class Exposure(NamedTuple):
    """Hours (m,) [h] and the covariates that they were flown at, (m, 3)."""

    hours: Array
    covariates: Array

    def aged(self, exponents: Array) -> Array:
        """Return the hours [h] by which components age, (…), given their exponents (…, 3): Σ h exp(β·z)."""
        return np.asarray(np.exp(exponents @ self.covariates.T) @ self.hours)


AT_REFERENCE = Exposure(np.ones(1), np.zeros((1, len(STRESSES))))
"""An hour at the reference: of a unit that has not flown."""


def exposure(
    pieces: Sequence[StressPiece], reference: StressReference | None, start: float, end: float
) -> Exposure:
    """Return the exposure from `start` to `end` [h]; hours of no piece are at the reference."""
    hours, covariates, rest = [], [], end - start
    for piece in pieces if reference is not None else ():
        within = min(piece.end, end) - max(piece.start, start)
        if within > 0 and reference is not None:
            hours.append(within)
            covariates.append(reference.covariates(piece.stress))
            rest -= within
    # Rounding may leave a little of the other sign.
    hours.append(max(rest, 0.0))
    covariates.append(np.zeros(len(STRESSES)))
    return Exposure(np.array(hours), np.array(covariates))


def ageing_ahead(
    pieces: Sequence[StressPiece],
    reference: StressReference | None,
    hours: float,
    exponents: Array,
    ahead: Stress | None = None,
) -> Array | float:
    """Return by how many hours components of `exponents` (…, 3) age in an hour to come, (…).

    As in the mean of the past, up to `hours` [h], but for the covariates y that `ahead` states:

        a = Σ h exp(β_x·x + β_y·y) / Σ h,   x: covariates of the h hours that were flown

    A covariate stays as in the past where `ahead` leaves it out, or nobody recorded it.
    """
    if reference is None:
        return 1.0
    flown = exposure(pieces, reference, 0.0, hours) if hours > 0 else AT_REFERENCE
    if ahead is not None:
        stated = [None not in pair for pair in zip(ahead.values, reference.values, strict=True)]
        flown = Exposure(flown.hours, np.where(stated, reference.covariates(ahead), flown.covariates))
    return np.asarray(flown.aged(exponents) / flown.hours.sum())


def stress_dict(reference: StressReference | None, ahead: Stress | None) -> dict[str, Any]:
    """Return as JSON the stress that hours are at, and the one to come that was asked for."""
    return {
        "reference": None if reference is None else dict(zip(STRESS_KEYS, reference.values, strict=True)),
        "ahead": None if ahead is None else dict(zip(STRESS_KEYS, ahead.values, strict=True)),
    }
