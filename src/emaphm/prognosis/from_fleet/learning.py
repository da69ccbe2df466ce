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
from emaphm.prognosis.laws import Mask, is_moving
from emaphm.prognosis.prior import NEW, Hypotheses, Prior, rate_when_new
from emaphm.prognosis.settings import FILTER
from emaphm.random_streams import stream

FOLLOWED_BY = replace(FILTER, trust=1.0)
"""Their filter: they have been followed for long, and what is kept of them is a sample, not a forecast."""

WEIGHT_OF_GENERAL = 2.0
"""Units that the general prior counts as: with two of a fleet, half of what is expected is the fleet's."""

FEWEST_DIAGNOSES = 3
"""Explained diagnoses of a unit below which it only repeats the general prior."""

SPREAD = 0.3
"""Standard deviation of a new unit's rate about that of another unit, as a share of it."""

DRAWN = 500
"""Hypotheses that each unit gives."""

KEPT = 150
"""Units whose hypotheses a process remembers, 0.4 MB each."""


@dataclass(frozen=True, eq=False)
class UnitHypotheses:
    """Hypotheses about a new unit from one other unit, each array (DRAWN, 8), and its own trajectories.

    A component that was replaced had more than one life. Its hypotheses are, in equal numbers, from the
    belief just before each replacement and from that of now. Each life has a trajectory; the first of the
    `trajectories` is of the first lives.
    """

    hypotheses: Hypotheses
    trajectories: tuple[Trajectory, ...]


HYPOTHESES: Memory[UnitHypotheses] = Memory(KEPT)


def hypotheses_of_unit(evidence: Evidence, general: Prior, seed: int) -> UnitHypotheses:
    """Return the hypotheses from a unit, followed from the `general` prior; errors as in `moments`."""
    return HYPOTHESES.get(
        fingerprint(evidence, general.settings, general.reference, seed),
        lambda: _followed(evidence, general, seed),
    )


def _followed(evidence: Evidence, general: Prior, seed: int) -> UnitHypotheses:
    hours, age, level = [], [], []
    ended: list[tuple[Hypotheses, Mask]] = []
    name = ("fleet's prior", evidence.unit)
    for moment in moments(evidence, general, seed=seed, settings=FOLLOWED_BY):
        belief = moment.belief
        if moment.observed:
            hours.append(belief.hours)
            age.append(np.sum(belief.weights * belief.aged, axis=0))
            level.append(belief.mean_level)
            continue
        # A life of few diagnoses only repeats the general prior.
        is_known = np.sum(np.array(hours)[:, np.newaxis] > belief.new_at, axis=0) >= FEWEST_DIAGNOSES
        if (moment.ends & is_known).any():
            random = stream(seed, *name, len(ended))
            ended.append((_hypotheses(belief, random), moment.ends & is_known))
    has_ended = np.any([np.zeros_like(is_known), *(which for _, which in ended)], axis=0)
    now = _hypotheses(belief, stream(seed, *name)), is_known | ~has_ended
    levels = np.array(hours), np.stack(age), np.stack(level)
    return UnitHypotheses(_merged([*ended, now]), tuple(_trajectories(evidence, *levels)))


def _merged(lives: Sequence[tuple[Hypotheses, Mask]]) -> Hypotheses:
    """Return hypotheses of components, each evenly from the lives in which it is known."""
    rows, columns = np.arange(DRAWN), np.arange(lives[0][0].law.shape[1])
    known = np.stack([which for _, which in lives])
    life = np.stack([np.resize(np.flatnonzero(which), DRAWN) for which in known.T], axis=1)
    fields = zip(*(hypotheses for hypotheses, _ in lives), strict=True)
    return Hypotheses(*(np.stack(one)[life, rows[:, np.newaxis], columns] for one in fields))


def _trajectories(evidence: Evidence, hours: Array, age: Array, level: Array) -> Iterator[Trajectory]:
    """Yield the trajectories of a unit, of first lives, then of second ones; `level` (n, 8) is filtered."""
    lives = [evidence.lives(column) for column in range(evidence.components)]
    for i in range(max(map(len, lives))):
        new_at, until = zip(*(one[i] if i < len(one) else (np.inf, np.inf) for one in lives), strict=True)
        yield Trajectory(hours, age, level, np.array(new_at), np.array(until), NEW)


def fleet_mixture(parts: Sequence[UnitHypotheses], general: Prior) -> Prior:
    """Return the mixture of the hypotheses of one or more units, and of the general prior."""
    columns = zip(*(one.hypotheses for one in parts), strict=True)
    fleet = Hypotheses(*(np.concatenate(column) for column in columns))
    return replace(
        general,
        fleet=fleet,
        fleet_share=len(parts) / (len(parts) + WEIGHT_OF_GENERAL),
        units=len(parts),
        trajectories=ReferenceTrajectories.of([each for one in parts for each in one.trajectories]),
    )


def with_fleet_pace(prior: Prior, followed: Sequence[str], others: Sequence[Evidence]) -> Prior:
    """Return a prior from the `followed` units with the pace of `others` added.

    The pace is at the mean of the fleet's exponents. `units` counts those of either kind, each once.
    """
    assert prior.fleet is not None  # noqa: S101 - it is a mixture
    model = FleetPaceModel(others, NEW, prior.reference, prior.fleet.exponents.mean(axis=0))
    return replace(prior, units=len({*followed, *(one.unit for one in others)}), fleet_pace=model)


def _hypotheses(belief: Belief, random: np.random.Generator) -> Hypotheses:
    rows = drawn_rows(belief, DRAWN, random)
    units = recombined(belief, rows)
    held = units.hypotheses()
    factor = rate_when_new(held, units.aged, belief.prior.settings)
    rate = np.where(is_moving(held.law), held.rate / factor, 0.0)
    deviation = np.hypot(held.rate_deviation / factor, SPREAD * np.abs(rate))
    # The direction of an eccentricity differs from unit to unit.
    plane = np.sqrt(np.mean(rate[:, ECCENTRICITY] ** 2 + deviation[:, ECCENTRICITY] ** 2, axis=1))
    rate[:, ECCENTRICITY], deviation[:, ECCENTRICITY] = 0.0, plane[:, np.newaxis]
    return held._replace(rate=rate, rate_deviation=np.where(is_moving(held.law), deviation, 0.0))
