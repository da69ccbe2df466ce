"""Hypotheses about a new unit from the other units of its part number: laws, life scales and rates."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.memory import Memory
from emaphm.prognosis.belief import Belief
from emaphm.prognosis.columns import ECCENTRICITY
from emaphm.prognosis.evidence import Evidence
from emaphm.prognosis.filter.following import moments
from emaphm.prognosis.filter.resampling import drawn_rows, recombined
from emaphm.prognosis.from_fleet.fingerprint import fingerprint
from emaphm.prognosis.from_fleet.fleet_pace import FleetPaceModel
from emaphm.prognosis.from_fleet.reference_trajectories import ReferenceTrajectories, Trajectory
from emaphm.prognosis.from_fleet.stress_exponents import (
    ExponentEstimates,
    exponents_of_new_unit,
    exponents_of_unit,
)
from emaphm.prognosis.laws import Mask, is_moving, transition
from emaphm.prognosis.prior import NEW, Hypotheses, Prior
from emaphm.prognosis.settings import FILTER, DegradationSettings
from emaphm.random_streams import stream

FOLLOWED_BY = replace(FILTER, trust=1.0)
"""Filter of the other units: their histories are long, and the result is a sample and not a forecast."""

WEIGHT_OF_GENERAL = 2.0
"""Number of units that the general prior counts as: with two units of a fleet, its share is a half."""

FEWEST_DIAGNOSES = 3
"""Explained diagnoses of a unit below which its posterior is about the general prior."""

SPREAD = 0.3
"""Standard deviation of a new unit's rate about that of another unit, as a share of the latter."""

DRAWN = 500
"""Number of hypotheses from each unit."""

KEPT = 150
"""Number of units whose hypotheses a process caches, 0.4 MB each."""


@dataclass(frozen=True, eq=False)
class UnitHypotheses:
    """Hypotheses about a new unit from one other unit, arrays (DRAWN, 8), and the unit's own trajectories.

    A replaced component had more than one life. Its hypotheses are drawn, in equal numbers, from the filter
    state just before each replacement and from the present one. Each life has a trajectory; the first of the
    `trajectories` contains the first lives.
    """

    hypotheses: Hypotheses
    trajectories: tuple[Trajectory, ...]
    exponents: ExponentEstimates | None = None


HYPOTHESES: Memory[UnitHypotheses] = Memory(KEPT)


def hypotheses_of_unit(evidence: Evidence, general: Prior, seed: int) -> UnitHypotheses:
    """Return the hypotheses from a unit, filtered from the `general` prior; errors as in `moments`."""
    return HYPOTHESES.get(
        fingerprint(evidence, general.settings, general.reference, seed),
        lambda: _computed_hypotheses(evidence, general, seed),
    )


def _computed_hypotheses(evidence: Evidence, general: Prior, seed: int) -> UnitHypotheses:
    """Return hypotheses and trajectories of a unit from its filter states before replacements and now."""
    hours, age, level = [], [], []
    ended_lives: list[tuple[Hypotheses, Mask]] = []
    name = ("fleet's prior", evidence.unit)
    for moment in moments(evidence, general, seed=seed, settings=FOLLOWED_BY):
        belief = moment.belief
        if moment.observed:
            hours.append(belief.hours)
            age.append(np.sum(belief.weights * belief.aged, axis=0))
            level.append(belief.mean_level)
            continue
        # The posterior of a life with few diagnoses is about the general prior.
        is_known = np.sum(np.array(hours)[:, np.newaxis] > belief.new_at, axis=0) >= FEWEST_DIAGNOSES
        if (moment.ends & is_known).any():
            random = stream(seed, *name, len(ended_lives))
            ended_lives.append((_hypotheses(belief, random), moment.ends & is_known))
    has_ended = np.any([np.zeros_like(is_known), *(mask for _, mask in ended_lives)], axis=0)
    now = _hypotheses(belief, stream(seed, *name)), is_known | ~has_ended
    levels = np.array(hours), np.stack(age), np.stack(level)
    reference, ranges = general.reference, general.settings.exponents
    return UnitHypotheses(
        _merged([*ended_lives, now]),
        tuple(_trajectories(evidence, *levels)),
        None if reference is None else exponents_of_unit(evidence, reference, ranges),
    )


def _merged(lives: Sequence[tuple[Hypotheses, Mask]]) -> Hypotheses:
    """Return hypotheses of components, in equal numbers from each life with enough diagnoses."""
    rows, columns = np.arange(DRAWN), np.arange(lives[0][0].law.shape[1])
    known = np.stack([mask for _, mask in lives])
    life = np.stack([np.resize(np.flatnonzero(mask), DRAWN) for mask in known.T], axis=1)
    fields = zip(*(hypotheses for hypotheses, _ in lives), strict=True)
    return Hypotheses(*(np.stack(values)[life, rows[:, np.newaxis], columns] for values in fields))


def _trajectories(evidence: Evidence, hours: Array, age: Array, level: Array) -> Iterator[Trajectory]:
    """Yield the trajectories of first lives, of second lives, …; `level` (n, 8) is filtered."""
    lives = [evidence.lives(column) for column in range(evidence.components)]
    for i in range(max(map(len, lives))):
        new_at, until = zip(
            *(of_column[i] if i < len(of_column) else (np.inf, np.inf) for of_column in lives), strict=True
        )
        yield Trajectory(hours, age, level, np.array(new_at), np.array(until), NEW)


def fleet_mixture(parts: Sequence[UnitHypotheses], general: Prior, seed: int) -> Prior:
    """Return the prior that mixes the hypotheses of one or more units with the general prior."""
    columns = zip(*(part.hypotheses for part in parts), strict=True)
    fleet = Hypotheses(*(np.concatenate(column) for column in columns))
    if general.reference is not None:
        random = stream(seed, "exponents of a new unit")
        of_units = [part.exponents for part in parts if part.exponents is not None]
        exponents = exponents_of_new_unit(of_units, fleet.exponents, general.settings.exponents, random)
        fleet = fleet._replace(exponents=exponents)
    return replace(
        general,
        fleet=fleet,
        fleet_share=len(parts) / (len(parts) + WEIGHT_OF_GENERAL),
        units=len(parts),
        trajectories=ReferenceTrajectories.of(
            [trajectory for part in parts for trajectory in part.trajectories]
        ),
    )


def with_fleet_pace(prior: Prior, followed: Sequence[str], others: Sequence[Evidence]) -> Prior:
    """Return a prior from the `followed` units, with the pace of the units `others`.

    The pace is at the mean of the fleet's exponents. `units` counts the units of either kind once.
    """
    assert prior.fleet is not None  # noqa: S101 - it is a mixture
    exponents = prior.fleet.exponents.mean(axis=0)
    model = FleetPaceModel(others, NEW, prior.reference, exponents, prior.missions)
    return replace(prior, units=len({*followed, *(other.unit for other in others)}), fleet_pace=model)


def _hypotheses(belief: Belief, random: np.random.Generator) -> Hypotheses:
    """Return hypotheses (DRAWN, 8) about a new unit, drawn from the filter state of another unit."""
    rows = drawn_rows(belief, DRAWN, random)
    units = recombined(belief, rows)
    posterior = units.hypotheses()
    factor = _rate_when_new(posterior, units.aged, belief.prior.settings)
    rate = np.where(is_moving(posterior.law), posterior.rate / factor, 0.0)
    deviation = np.hypot(posterior.rate_deviation / factor, SPREAD * np.abs(rate))
    # The direction of an eccentricity differs from unit to unit.
    plane = np.sqrt(np.mean(rate[:, ECCENTRICITY] ** 2 + deviation[:, ECCENTRICITY] ** 2, axis=1))
    rate[:, ECCENTRICITY], deviation[:, ECCENTRICITY] = 0.0, plane[:, np.newaxis]
    return posterior._replace(rate=rate, rate_deviation=np.where(is_moving(posterior.law), deviation, 0.0))


def _rate_when_new(hypotheses: Hypotheses, age: Array, settings: DegradationSettings) -> Array:
    """Return the ratio of the rate at `age` [h] to the rate of the new component, in the shape of `age`."""
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
