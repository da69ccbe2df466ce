"""What other units of the same part number teach about a new one: laws, life scales and rates."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from emaphm.arrays import Array
from emaphm.prognosis.belief import Belief
from emaphm.prognosis.evidence import Evidence, Followed, follow
from emaphm.prognosis.from_fleet.references import References, Track
from emaphm.prognosis.laws import is_moving
from emaphm.prognosis.prior import COMPONENTS, NEW, Hypotheses, Prior, rate_when_new
from emaphm.prognosis.resampling import drawn_rows, recombined
from emaphm.prognosis.settings import FILTER
from emaphm.prognosis.stress import StressReference
from emaphm.random_streams import stream

if TYPE_CHECKING:
    from emaphm.history import History, Unit

MOST_UNITS = 30
"""Units that are followed."""

T = TypeVar("T")

FOLLOWED_BY = replace(FILTER, particles=300)
"""Their filter: a third of a prognosis's particles, since its draws are pooled; 2 ms a diagnosis."""

WEIGHT_OF_GENERAL = 2.0
"""Units that the general prior counts as: with two of a fleet, half of what is expected is the fleet's."""

FEWEST_DIAGNOSES = 3
"""Explained diagnoses of a unit below which it teaches nothing that was not put in."""

SPREAD = 0.3
"""Standard deviation of a new unit's rate about that of another unit, as a share of it."""

SPREADS = ((0.1, 0.05), (0.2, 0.1), (0.4, 0.1), (0.4, 0.3))
"""Spreads that are tried of units that go the same way: of the time's logarithm and of the amplitude.

From units that are nearly alike to such whose lives differ by half; the last, widest, holds for a fleet of
one, which shows no spread.
"""

MOST_TRIED = 10
"""Units on which they are tried."""

DRAWN = 200
"""Particles that each unit gives."""


def fellows(history: "History", unit: "Unit") -> list[Evidence]:
    """Return what a history says of other units of the part number that have enough diagnoses.

    `MOST_UNITS` at most; `HistoryError` where the database fails.
    """
    others = [
        one
        for one in history.overviews(unit.part_number)
        if one.explained >= FEWEST_DIAGNOSES and one.unit.serial_number != unit.serial_number
    ]
    others.sort(key=lambda one: (-one.explained, one.unit.serial_number))
    return [Evidence.of(history.unit(one.unit.serial_number)) for one in evenly(others)]


def evenly(ordered: Sequence[T], most: int = MOST_UNITS) -> list[T]:
    """Return at most `most` of what is ordered by its number of diagnoses, from all of its range.

    Those with most diagnoses alone would be those that live longest, and teach that units do.
    """
    if len(ordered) <= most:
        return list(ordered)
    return [ordered[i] for i in np.linspace(0, len(ordered) - 1, most).astype(int)]


def fleet_prior(others: Sequence[Evidence], prior: Prior | None = None, *, seed: int = 0) -> Prior:
    """Return the prior of a new unit, given the `others` of its part number.

    Each of the others is followed from the general prior; draws from what is then believed of it, all units
    alike, are what the new unit may be: its hypothesis is one of theirs with probability n / (n + 2), n being
    their number, else of the general prior. A rate is taken back to the new component's by its law. This is
    an empirical Bayes estimate of the distribution over units, which is wider than it by each unit's own
    uncertainty.

    Errors as in `follow`.
    """
    general = prior or Prior()
    chosen = [one for one in others if len(one.used) >= FEWEST_DIAGNOSES]
    chosen = evenly(sorted(chosen, key=lambda one: (-len(one.used), one.unit)))
    if not chosen:
        return general
    reference = general.reference or StressReference.of([piece for one in chosen for piece in one.stresses])
    general = replace(general, reference=reference)
    prior = pooled([taught_by(one, general, seed) for one in chosen], general)
    return replace(prior, spreads=likeliest_spreads(chosen, prior, seed))


@dataclass(frozen=True, eq=False)
class Taught:
    """What one unit teaches: hypotheses of a new unit, each array (DRAWN, 8), and the way that it went."""

    hypotheses: Hypotheses
    track: Track


def taught_by(evidence: Evidence, general: Prior, seed: int) -> Taught:
    """Return what a unit teaches, followed from the `general` prior; errors as in `follow`."""
    followed = follow(evidence, general, seed=seed, settings=FOLLOWED_BY)
    return Taught(_hypotheses(followed.belief, evidence.unit, seed), _track(followed))


def pooled(parts: Sequence[Taught], general: Prior, spreads: Array | None = None) -> Prior:
    """Return the prior that several units, one or more, teach together; `spreads` as in `Prior`."""
    columns = zip(*(one.hypotheses for one in parts), strict=True)
    return replace(
        general,
        fleet=Hypotheses(*(np.concatenate(column) for column in columns)),
        fleet_share=len(parts) / (len(parts) + WEIGHT_OF_GENERAL),
        units=len(parts),
        references=References.of([one.track for one in parts]),
        spreads=spreads,
    )


def likeliest_spreads(chosen: Sequence[Evidence], prior: Prior, seed: int) -> Array:
    """Return the spreads (2, 8) of the `SPREADS` under which the units are likeliest, given the others.

    Each component's by its own diagnoses (empirical Bayes, or maximum likelihood of the second type).
    """
    candidates = np.repeat(np.array(SPREADS)[:, :, np.newaxis], COMPONENTS, axis=2)
    if len(chosen) < 2 or prior.references is None:
        return np.asarray(candidates[-1])
    total = np.zeros((len(SPREADS), COMPONENTS))
    rows = np.unique(np.linspace(0, len(chosen) - 1, min(MOST_TRIED, len(chosen))).astype(int))
    for i in rows:
        of_others = replace(prior, references=prior.references.without(int(i)))
        for j, spreads in enumerate(candidates):
            tried = replace(of_others, spreads=spreads)
            held = follow(chosen[i], tried, seed=seed, settings=FOLLOWED_BY).belief
            total[j] += held.log_likelihood
    best = total.argmax(axis=0)
    return np.asarray(candidates[best, :, np.arange(COMPONENTS)].T)


def _track(followed: Followed) -> Track:
    """Return the levels of a unit over its hours, as filtered."""
    return Track(
        hours=np.array([one.hours for one in followed.past]),
        age=np.stack([np.sum(one.weights * one.aged, axis=0) for one in followed.past]),
        level=np.stack([one.mean_level for one in followed.past]),
        born=followed.belief.born,
        new=NEW,
    )


def _hypotheses(belief: Belief, unit: str, seed: int) -> Hypotheses:
    rows = drawn_rows(belief, DRAWN, stream(seed, "fleet's prior", unit))
    units = recombined(belief, rows)
    held = units.hypotheses()
    factor = rate_when_new(held, units.aged, belief.prior.settings)
    rate = np.where(is_moving(held.law), held.rate / factor, 0.0)
    deviation = np.hypot(held.rate_deviation / factor, SPREAD * np.abs(rate))
    return held._replace(rate=rate, rate_deviation=np.where(is_moving(held.law), deviation, 0.0))
