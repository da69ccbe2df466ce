"""What is believed of a component's degradation before it is seen: in general, or learnt from a fleet."""

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
from emaphm.prognosis.from_fleet.recalibration import Recalibration
from emaphm.prognosis.from_fleet.reference_trajectories import ReferenceTrajectories
from emaphm.prognosis.laws import AnyArray, Mask, Numbers, in_common, rate_scale, transition
from emaphm.prognosis.settings import (
    AS_ANOTHER,
    CRACK_GROWTH,
    DEGRADATION,
    EXPONENTIAL,
    LINEAR,
    POWER_LAW,
    SUDDEN_ONSET,
    DegradationSettings,
)
from emaphm.prognosis.stress import STRESSES, StressReference

NEW = to_cartesian(HEALTHY.vector)
"""Levels of a healthy unit, shape (8,), in the order of `CARTESIAN_NAMES`."""


Rows = NDArray[np.intp] | slice
"""Of arrays whose first axis is that of the particles."""

EVERY_ROW = slice(None)


def with_rows(before: AnyArray, rows: Rows, where: Mask, new: AnyArray) -> AnyArray:
    """Return `before` (n, …) with `new` (k, …) in its `rows` (k,), `where` (k, …) is True."""
    result = before.copy()
    result[rows] = np.where(where, new, before[rows])
    return result


TRAJECTORY_SHARE = 0.5
"""Share of a fleet's hypotheses that are trajectories of its units; the others are parameters of laws."""


class Hypotheses(NamedTuple):
    """Laws with their parameters, and what is known of the rate under each; any one shape.

    law
        Numbers of `LAWS`.
    life_scale, shape
        T [h]; time constant as a share of T, exponent, or number of another unit.
    roughness
        Of the process noise, relative to the settings' [-].
    unevenness
        Standard deviation of the ageing within T, as a share of T [-].
    rate, rate_deviation
        Mean and standard deviation of the rate [1/h] when the component is new, or at an onset or change.
    exponents
        Of the stress covariates, one axis more, of 3: `STRESSES`.
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
    """The prior of the degradation: `settings`, and where a fleet was seen, its hypotheses.

    A component's hypothesis is one of the fleet's, `fleet` of shape (k, 8), with probability `fleet_share`,
    else drawn by the settings: a fleet of few units has shown few ways to degrade. A share of the fleet's
    hypotheses are the `trajectories` of its units. `reference` is the stress that hours and rates are at;
    None where no stress was recorded, and an hour is an hour. `recalibration` is how the fleet's own
    predictions turned out, `fleet_pace` the pace of its units. `units` is how many count in any of that.
    `least_friction` is that of the actuator.
    """

    settings: DegradationSettings = DEGRADATION
    fleet: Hypotheses | None = None
    fleet_share: float = 0.0
    units: int = 0
    reference: StressReference | None = None
    trajectories: ReferenceTrajectories | None = None
    recalibration: Recalibration | None = None
    fleet_pace: FleetPaceModel | None = None
    least_friction: float = LOWEST_FRICTION

    def of(self, actuator: Actuator) -> "Prior":
        """Return the prior for a unit whose levels have the bounds of `actuator`."""
        return replace(self, least_friction=float(lower_bounds(actuator)[0]))

    def draw(self, particles: int, random: np.random.Generator, components: int = COORDINATES) -> Hypotheses:
        """Return hypotheses of the first `components` of a new unit, each array (particles, components)."""
        own = self.general(np.zeros((particles, components)), random)
        if self.fleet is None:
            return own
        rows = in_common(random.integers(len(self.fleet.law), size=own.law.shape))
        is_fleets = in_common(random.random(own.law.shape)) < self.fleet_share
        columns = np.arange(components)

        def chosen(theirs: Array, mine: Array) -> Array:
            return np.asarray(np.where(is_fleets, theirs[rows, columns], mine))

        drawn = Hypotheses(
            law=np.where(is_fleets, self.fleet.law[rows, columns], own.law),
            life_scale=chosen(self.fleet.life_scale, own.life_scale),
            shape=chosen(self.fleet.shape, own.shape),
            roughness=chosen(self.fleet.roughness, own.roughness),
            unevenness=chosen(self.fleet.unevenness, own.unevenness),
            rate=chosen(self.fleet.rate, own.rate),
            rate_deviation=chosen(self.fleet.rate_deviation, own.rate_deviation),
            exponents=np.where(
                is_fleets[..., np.newaxis], self.fleet.exponents[rows, columns], own.exponents
            ),
        )
        as_trajectory = in_common(random.random(own.law.shape)) < TRAJECTORY_SHARE
        return self._as_others(drawn, is_fleets & as_trajectory, random)

    def _as_others(self, drawn: Hypotheses, where: Mask, random: np.random.Generator) -> Hypotheses:
        """Return the hypotheses (n, 8); `where` True, that the component follows another unit's trajectory.

        Its time and amplitude differ from the other unit's by one of the settings' `spreads`; the
        coordinates of an eccentricity have any amplitude up to about its own.
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
        """Return hypotheses by the settings alone, of components of that `age` (n, c) [h], each (n, c)."""
        s = self.settings
        law = random.choice(len(s.laws), size=age.shape, p=s.laws).astype(np.int8)
        life_scale = _log_uniform(s.life_scale, random, age.shape)
        uniform = random.random(age.shape)
        form = np.ones(age.shape)
        for one, (low, high) in ((POWER_LAW, s.exponent), (EXPONENTIAL, s.growth), (CRACK_GROWTH, s.crack)):
            form = np.where(law == one, np.exp(np.log(low) + uniform * np.log(high / low)), form)
        # A crack that has not become infinite until now does so later.
        life_scale = np.where(law == CRACK_GROWTH, age + life_scale, life_scale)
        deviation = rate_scale(law, life_scale, form, age, s)
        roughness = _log_uniform(s.roughness, random, age.shape)
        unevenness = _log_uniform(s.unevenness, random, age.shape)
        rate, exponents = np.zeros(age.shape), self._exponents(age.shape, random)
        drawn = Hypotheses(
            law=law,
            life_scale=life_scale,
            shape=form,
            roughness=roughness,
            unevenness=unevenness,
            rate=rate,
            rate_deviation=deviation,
            exponents=exponents,
        )
        return Hypotheses._make(in_common(one) for one in drawn)

    def _exponents(self, shape: tuple[int, ...], random: np.random.Generator) -> Array:
        if self.reference is None:
            return np.zeros((*shape, len(STRESSES)))
        low, high = np.array(self.settings.exponents).T
        return np.asarray(random.uniform(low, high, (*shape, len(STRESSES))))

    def after_onset(self, shape: tuple[int, ...], random: np.random.Generator) -> Hypotheses:
        """Return linear hypotheses for components whose degradation has just set in, each of `shape`."""
        drawn = self.general(np.zeros(shape), random)
        law = np.full_like(drawn.law, LINEAR)
        return drawn._replace(law=law, rate_deviation=1 / drawn.life_scale)


def _log_uniform(ends: tuple[float, float], random: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Return numbers of `shape` between `ends`, whose logarithms are uniform."""
    low, high = ends
    return np.asarray(np.exp(random.uniform(math.log(low), math.log(high), shape)))


def replace_law_fields(before: Any, rows: Rows, where: Mask, drawn: Hypotheses) -> dict[str, Any]:
    """Return the fields of a belief or state that say its laws, those of `drawn` as in `with_rows`."""
    names = ("law", "life_scale", "shape", "roughness", "unevenness")
    return {name: with_rows(getattr(before, name), rows, where, getattr(drawn, name)) for name in names}


def rate_when_new(hypotheses: Hypotheses, age: Array, settings: DegradationSettings) -> Array:
    """Return by what to divide the rate at `age` [h] to get that of the new component, any one shape."""
    start = np.full_like(age, settings.first_hours)
    _, growth = transition(
        hypotheses.law,
        hypotheses.life_scale,
        hypotheses.shape,
        start,
        np.maximum(age - start, 0.0),
        settings,
    )
    return growth


def is_waiting(law: Numbers) -> Mask:
    """Return whether a component is of sudden onset, before it."""
    return np.asarray(law == SUDDEN_ONSET)
