"""Prior of the degradation of a component: general, or learnt from a fleet."""

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator import Actuator
from emaphm.actuator.faults import HEALTHY, lower_bounds, to_cartesian
from emaphm.actuator.requirements import LOWEST_FRICTION
from emaphm.arrays import Array
from emaphm.prognosis.bounds import COORDINATES
from emaphm.prognosis.columns import ECCENTRICITY
from emaphm.prognosis.from_fleet.fleet_pace import FleetPaceModel
from emaphm.prognosis.from_fleet.missions import UNKNOWN, Missions
from emaphm.prognosis.from_fleet.recalibration import Recalibration
from emaphm.prognosis.from_fleet.reference_trajectories import ReferenceTrajectories
from emaphm.prognosis.laws import AnyArray, Mask, Numbers, in_common, rate_scale
from emaphm.prognosis.settings import (
    AS_ANOTHER,
    CRACK_GROWTH,
    DEGRADATION,
    EXPONENTIAL,
    LINEAR,
    POWER_LAW,
    DegradationSettings,
)
from emaphm.prognosis.stress import STRESSES, StressReference

NEW = to_cartesian(HEALTHY.vector)
"""Levels of a healthy unit, shape (8,), in the order of `CARTESIAN_NAMES`."""


Rows = NDArray[np.intp] | slice
"""Index of rows, in arrays whose first axis is that of the particles."""

EVERY_ROW = slice(None)


def with_rows(before: AnyArray, rows: Rows, where: Mask, new: AnyArray) -> AnyArray:
    """Return `before` (n, …) with its `rows` (k,) replaced by `new` (k, …) where `where` (k, …) is True."""
    result = before.copy()
    result[rows] = np.where(where, new, before[rows])
    return result


TRAJECTORY_SHARE = 0.5
"""Share of a fleet's hypotheses that are trajectories of its units; the rest are parameters of laws."""


class Hypotheses(NamedTuple):
    """Laws with their parameters and the prior of the rate under each law; all arrays have the same shape.

    law
        Numbers of `LAWS`.
    life_scale, shape
        T [h]; time constant as a share of T, exponent, or number of another unit.
    roughness
        Process noise relative to that of the settings [-].
    unevenness
        Standard deviation of the ageing within T, as a share of T [-].
    rate, rate_deviation
        Mean and standard deviation of the rate [1/h] when the component is new, or at an onset or change.
    exponents
        Exponents of the stress covariates, with an additional last axis of length 3 (`STRESSES`).
    """

    law: Numbers
    life_scale: Array
    shape: Array
    roughness: Array
    unevenness: Array
    rate: Array
    rate_deviation: Array
    exponents: Array


@dataclass(frozen=True, eq=False)
class Prior:
    """The prior of the degradation: `settings` and, if a fleet is given, its hypotheses.

    With probability `fleet_share`, a component's hypothesis is drawn from those of the fleet, `fleet` of
    shape (k, 8); otherwise it is drawn from the settings, because a fleet of few units covers few courses of
    degradation. A share of the fleet's hypotheses are the `trajectories` of its units. `reference` is the
    stress to which hours and rates refer; if it is None, no stress was recorded and hours are not converted.
    `missions` is the variation of the stress between units and intervals.
    `recalibration` contains the errors of predictions of the fleet's own failures, `fleet_pace` the pace of
    its units, `units` the number of units used for any of these. `least_friction` is the lower bound of the
    actuator's friction.
    """

    settings: DegradationSettings = DEGRADATION
    fleet: Hypotheses | None = None
    fleet_share: float = 0.0
    units: int = 0
    reference: StressReference | None = None
    missions: Missions = UNKNOWN
    trajectories: ReferenceTrajectories | None = None
    recalibration: Recalibration | None = None
    fleet_pace: FleetPaceModel | None = None
    least_friction: float = LOWEST_FRICTION

    def of(self, actuator: Actuator) -> "Prior":
        """Return the prior for a unit whose levels have the bounds of `actuator`."""
        return replace(self, least_friction=float(lower_bounds(actuator)[0]))

    def draw(self, particles: int, random: np.random.Generator, components: int = COORDINATES) -> Hypotheses:
        """Return hypotheses for the first `components` of a new unit, arrays (particles, components)."""
        own = self.general(np.zeros((particles, components)), random)
        if self.fleet is None:
            return own
        rows = in_common(random.integers(len(self.fleet.law), size=own.law.shape))
        is_fleets = in_common(random.random(own.law.shape)) < self.fleet_share
        columns = np.arange(components)

        def selected(of_fleet: Array, of_settings: Array) -> Array:
            return np.asarray(np.where(is_fleets, of_fleet[rows, columns], of_settings))

        drawn = Hypotheses(
            law=np.where(is_fleets, self.fleet.law[rows, columns], own.law),
            life_scale=selected(self.fleet.life_scale, own.life_scale),
            shape=selected(self.fleet.shape, own.shape),
            roughness=selected(self.fleet.roughness, own.roughness),
            unevenness=selected(self.fleet.unevenness, own.unevenness),
            rate=selected(self.fleet.rate, own.rate),
            rate_deviation=selected(self.fleet.rate_deviation, own.rate_deviation),
            exponents=np.where(
                is_fleets[..., np.newaxis], self.fleet.exponents[rows, columns], own.exponents
            ),
        )
        as_trajectory = in_common(random.random(own.law.shape)) < TRAJECTORY_SHARE
        return self._as_others(drawn, is_fleets & as_trajectory, random)

    def _as_others(self, drawn: Hypotheses, where: Mask, random: np.random.Generator) -> Hypotheses:
        """Return the hypotheses (n, 8), following another unit's trajectory where `where` (n, 8) is True.

        Time and amplitude differ from those of the other unit by one of the settings' `spreads`; the
        coordinates of an eccentricity have any amplitude up to about that of the other unit.
        """
        if self.trajectories is None:
            return drawn
        spreads = np.array(self.settings.spreads)
        choice = in_common(random.integers(len(spreads), size=where.shape))
        of_time, of_amplitude = np.moveaxis(spreads[choice], -1, 0)
        unit, span = self.trajectories.drawn((where.shape[0], where.shape[1]), random)
        unit, span = in_common(unit), in_common(span)
        scale = span * np.exp(of_time * in_common(random.standard_normal(where.shape)))
        where = where & (span > 0)
        rate = 1 / np.where(where, scale, 1.0)
        deviation = of_amplitude * rate
        deviation[:, ECCENTRICITY] = rate[:, ECCENTRICITY] / np.sqrt(2)
        rate[:, ECCENTRICITY] = 0.0
        return drawn._replace(
            law=np.where(where, AS_ANOTHER, drawn.law).astype(np.int8),
            life_scale=np.where(where, scale, drawn.life_scale),
            shape=np.where(where, unit, drawn.shape),
            rate=np.where(where, rate, drawn.rate),
            rate_deviation=np.where(where, deviation, drawn.rate_deviation),
        )

    def general(self, age: Array, random: np.random.Generator) -> Hypotheses:
        """Return hypotheses (n, c) drawn from the settings alone, for components of `age` (n, c) [h]."""
        s = self.settings
        law = random.choice(len(s.laws), size=age.shape, p=s.laws).astype(np.int8)
        life_scale = _log_uniform(s.life_scale, random, age.shape)
        uniform = random.random(age.shape)
        shape = np.ones(age.shape)
        for number, (low, high) in (
            (POWER_LAW, s.exponent),
            (EXPONENTIAL, s.growth),
            (CRACK_GROWTH, s.crack),
        ):
            shape = np.where(law == number, np.exp(np.log(low) + uniform * np.log(high / low)), shape)
        # A crack that is not infinite yet becomes infinite later.
        life_scale = np.where(law == CRACK_GROWTH, age + life_scale, life_scale)
        deviation = rate_scale(law, life_scale, shape, age, s)
        roughness = _log_uniform(s.roughness, random, age.shape)
        unevenness = _log_uniform(s.unevenness, random, age.shape)
        rate, exponents = np.zeros(age.shape), self._exponents(age.shape, random)
        drawn = Hypotheses(
            law=law,
            life_scale=life_scale,
            shape=shape,
            roughness=roughness,
            unevenness=unevenness,
            rate=rate,
            rate_deviation=deviation,
            exponents=exponents,
        )
        return Hypotheses._make(in_common(values) for values in drawn)

    def _exponents(self, shape: tuple[int, ...], random: np.random.Generator) -> Array:
        if self.reference is None:
            return np.zeros((*shape, len(STRESSES)))
        low, high = np.array(self.settings.exponents).T
        return np.asarray(random.uniform(low, high, (*shape, len(STRESSES))))

    def after_onset(self, shape: tuple[int, ...], random: np.random.Generator) -> Hypotheses:
        """Return linear hypotheses of `shape` for components whose degradation has just started."""
        drawn = self.general(np.zeros(shape), random)
        law = np.full_like(drawn.law, LINEAR)
        return drawn._replace(law=law, rate_deviation=1 / drawn.life_scale)


def _log_uniform(ends: tuple[float, float], random: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Return random numbers of `shape` between `ends`, uniform in the logarithm."""
    low, high = ends
    return np.asarray(np.exp(random.uniform(math.log(low), math.log(high), shape)))


def replace_law_fields(before: Any, rows: Rows, where: Mask, drawn: Hypotheses) -> dict[str, Any]:
    """Return the law fields of a filter state or `UnitDraws`, replaced by `drawn` as in `with_rows`."""
    names = ("law", "life_scale", "shape", "roughness", "unevenness")
    return {name: with_rows(getattr(before, name), rows, where, getattr(drawn, name)) for name in names}
