"""What other units of the same part number teach about a new one: laws, life scales and rates."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from emaphm.arrays import Array
from emaphm.memory import Memory
from emaphm.prognosis.belief import Belief
from emaphm.prognosis.columns import ECCENTRICITY
from emaphm.prognosis.evidence import Evidence, moments
from emaphm.prognosis.filter.resampling import drawn_rows, recombined
from emaphm.prognosis.from_fleet.fingerprint import fingerprint
from emaphm.prognosis.from_fleet.outlook import Fellows
from emaphm.prognosis.from_fleet.recalibration import Recalibration
from emaphm.prognosis.from_fleet.record import record_of
from emaphm.prognosis.from_fleet.references import References, Track
from emaphm.prognosis.laws import Mask, is_moving
from emaphm.prognosis.prior import NEW, Hypotheses, Prior, rate_when_new
from emaphm.prognosis.settings import FILTER
from emaphm.prognosis.stress import StressReference
from emaphm.random_streams import stream

if TYPE_CHECKING:
    from emaphm.actuator import Actuator
    from emaphm.history import History, Unit
    from emaphm.history.views import UnitState

MOST_UNITS = 30
"""Units that are followed."""

MOST_FELLOWS = 100
"""Units whose pace is learnt, from their diagnoses alone: that costs less than to follow them, and more of
them say more (docs/fleet.md)."""

T = TypeVar("T")

FOLLOWED_BY = replace(FILTER, trust=1.0)
"""Their filter: they have been followed for long, and what is kept of them is a sample, not a forecast."""

WEIGHT_OF_GENERAL = 2.0
"""Units that the general prior counts as: with two of a fleet, half of what is expected is the fleet's."""

FEWEST_DIAGNOSES = 3
"""Explained diagnoses of a unit below which it teaches nothing that was not put in."""

SPREAD = 0.3
"""Standard deviation of a new unit's rate about that of another unit, as a share of it."""

DRAWN = 500
"""Particles that each unit gives."""

KEPT = 150
"""Units whose teaching a process remembers, 0.4 MB each."""


def learnt_prior(
    history: "History",
    unit: "Unit",
    *,
    seed: int = 0,
    most: int | None = None,
    actuator: "Actuator | None" = None,
) -> Prior:
    """Return the `fleet_prior` of a unit, by the others of its part number that have enough diagnoses.

    Chosen from the whole fleet before the unit is left out, so that all its units learn from the same ones: a
    process that makes one prognosis after the other follows each of them once, and learns their pace once for
    all units that are none of them.

    Parameters
    ----------
    history, unit
        The open history, and a unit of it, `history.unit(serial_number)`.
    seed
        Source of all randomness.
    most
        Diagnoses of each of the others that are used at most; all where left out.
    actuator
        Its requirements say when a unit has failed; that of the unit's last diagnosis where left out.

    Raises
    ------
    PrognosisError
        A diagnosis of one of the others cannot be used.
    HistoryError
        The database fails.
    """
    teaching = [one for one in history.states(unit.part_number) if one.explained >= FEWEST_DIAGNOSES]
    followed, paced = names_of(teachers(teaching)), names_of(teachers_of_pace(teaching))
    evidence = {name: Evidence.of(history.unit(name), most) for name in {*followed, *paced}}
    chosen = [evidence[name] for name in followed]
    general = Prior(reference=reference_of(chosen))
    taught = {
        one.unit: taught_by(one, general, seed)
        for one in chosen
        if len(one.used) >= FEWEST_DIAGNOSES and (one.unit != unit.serial_number or one.failures)
    }
    record = recalibration_by(chosen, taught, general, actuator or unit.actuator, seed)
    return prior_of(unit.serial_number, taught, [evidence[name] for name in paced], general, record)


def prior_of(
    unit: str,
    taught: "Mapping[str, Taught]",
    fellows: Sequence[Evidence],
    general: Prior,
    record: Recalibration | None,
) -> Prior:
    """Return the prior of a unit, by what the others of its fleet have `taught`, their pace and their record.

    The general one where no other teaches.
    """
    names = [name for name in taught if name != unit][:MOST_UNITS]
    if not names:
        return general
    others = [one for one in fellows if one.unit != unit][:MOST_FELLOWS]
    prior = with_pace(pooled([taught[name] for name in names], general), names, others)
    return prior if record is None else replace(prior, recalibration=record.without(unit))


def failed_of(chosen: Sequence[Evidence]) -> list[Evidence]:
    """Return the units that failed and teach."""
    return [one for one in chosen if one.failures and len(one.used) >= FEWEST_DIAGNOSES]


def recalibration_by(
    chosen: Sequence[Evidence],
    taught: Mapping[str, "Taught"],
    general: Prior,
    actuator: "Actuator",
    seed: int,
) -> Recalibration | None:
    """Return how predictions of those units turned out that failed, each from the others that failed.

    Units that still work say nothing here, so that their next diagnosis changes nothing of it. `taught` is
    what each that failed teaches. Errors as in `fleet_prior`.
    """
    failed = failed_of(chosen)
    parts = [taught[one.unit] for one in failed]

    def by_others(i: int) -> Prior:
        return pooled([*parts[:i], *parts[i + 1 :]], general)

    return record_of(failed, by_others, (general.settings, general.reference), actuator, seed)


def reference_of(units: Sequence[Evidence]) -> StressReference | None:
    """Return the stress that hours and rates of a fleet are at: what its units saw on the median, rounded."""
    found = StressReference.of([piece for one in units for piece in one.stresses])
    return None if found is None else found.rounded()


def teachers(states: "Sequence[UnitState]") -> "list[UnitState]":
    """Return the units of a fleet that teach: one more than a unit learns from, as it may be one of them."""
    return evenly(_by_diagnoses(states), MOST_UNITS + 1)


def teachers_of_pace(states: "Sequence[UnitState]") -> "list[UnitState]":
    """Return the units of a fleet whose pace is learnt: one more than a unit's, as in `teachers`."""
    return evenly(_by_diagnoses(states), MOST_FELLOWS + 1)


def names_of(states: "Sequence[UnitState]") -> list[str]:
    """Return the serial numbers."""
    return [one.serial_number for one in states]


def _by_diagnoses(states: "Sequence[UnitState]") -> "list[UnitState]":
    return sorted(states, key=lambda one: (-one.explained, one.serial_number))


def evenly(ordered: Sequence[T], most: int = MOST_UNITS) -> list[T]:
    """Return at most `most` of what is ordered by its number of diagnoses, from all of its range.

    Those with most diagnoses alone would be those that live longest, and teach that units do.
    """
    if len(ordered) <= most:
        return list(ordered)
    return [ordered[i] for i in np.linspace(0, len(ordered) - 1, most).astype(int)]


def fleet_prior(
    others: Sequence[Evidence],
    *,
    seed: int = 0,
    actuator: "Actuator | None" = None,
) -> Prior:
    """Return the prior of a new unit, given the `others` of its part number; the general one without any.

    Each of the others is followed from the general prior; draws from what is then believed of it, all units
    alike, are what the new unit may be: its hypothesis is one of theirs with probability n / (n + 2), n being
    their number, else of the general prior. A rate is taken back to the new component's by its law. This is
    an empirical Bayes estimate of the distribution over units, which is wider than it by each unit's own
    uncertainty.

    Parameters
    ----------
    others
        Diagnoses and replacements of each; one with fewer than `FEWEST_DIAGNOSES` explained ones is left out.
    seed
        Source of all randomness.
    actuator
        Its requirements say what a failure is: forecasts are corrected by how those of the failed units
        turned out. They are not where left out.

    Raises
    ------
    PrognosisError
        A diagnosis of one of the others cannot be used.
    """
    general = Prior()
    teaching = [one for one in others if len(one.used) >= FEWEST_DIAGNOSES]
    teaching = sorted(teaching, key=lambda one: (-len(one.used), one.unit))
    chosen = evenly(teaching)
    if not chosen:
        return general
    general = Prior(reference=StressReference.of([piece for one in chosen for piece in one.stresses]))
    taught = {one.unit: taught_by(one, general, seed) for one in chosen}
    prior = with_pace(pooled(list(taught.values()), general), list(taught), evenly(teaching, MOST_FELLOWS))
    if actuator is None:
        return prior
    return replace(prior, recalibration=recalibration_by(chosen, taught, general, actuator, seed))


@dataclass(frozen=True, eq=False)
class Taught:
    """What one unit teaches: hypotheses of a new unit, each array (DRAWN, 8), and the ways that it went.

    A component that was replaced had more than one life: it teaches what was believed just before, and what
    is believed now, by as many hypotheses of each, and the way of each; the first `ways` are first lives.
    """

    hypotheses: Hypotheses
    ways: tuple[Track, ...]


TAUGHT: Memory[Taught] = Memory(KEPT)


def taught_by(evidence: Evidence, general: Prior, seed: int) -> Taught:
    """Return what a unit teaches, followed from the `general` prior; errors as in `moments`."""
    return TAUGHT.get(
        fingerprint(evidence, general.settings, general.reference, seed),
        lambda: _taught(evidence, general, seed),
    )


def _taught(evidence: Evidence, general: Prior, seed: int) -> Taught:
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
        # A life of few diagnoses teaches nothing that was not put in.
        is_known = np.sum(np.array(hours)[:, np.newaxis] > belief.born, axis=0) >= FEWEST_DIAGNOSES
        if (moment.ends & is_known).any():
            random = stream(seed, *name, len(ended))
            ended.append((_hypotheses(belief, random), moment.ends & is_known))
    has_ended = np.any([np.zeros_like(is_known), *(which for _, which in ended)], axis=0)
    now = _hypotheses(belief, stream(seed, *name)), is_known | ~has_ended
    track = np.array(hours), np.stack(age), np.stack(level)
    return Taught(_merged([*ended, now]), tuple(_ways(evidence, *track)))


def _merged(lives: "Sequence[tuple[Hypotheses, Mask]]") -> Hypotheses:
    """Return hypotheses of components, each from those lives that are said to teach of it, evenly."""
    rows, columns = np.arange(DRAWN), np.arange(lives[0][0].law.shape[1])
    teaching = np.stack([which for _, which in lives])
    life = np.stack([np.resize(np.flatnonzero(which), DRAWN) for which in teaching.T], axis=1)
    fields = zip(*(hypotheses for hypotheses, _ in lives), strict=True)
    return Hypotheses(*(np.stack(one)[life, rows[:, np.newaxis], columns] for one in fields))


def _ways(evidence: Evidence, hours: Array, age: Array, level: Array) -> Iterator[Track]:
    """Yield the filtered levels (n, 8) of a unit at `hours` (n,) [h]: of first lives, then of second ones."""
    lives = [evidence.lives(column) for column in range(evidence.components)]
    for i in range(max(map(len, lives))):
        born, until = zip(*(one[i] if i < len(one) else (np.inf, np.inf) for one in lives), strict=True)
        yield Track(hours, age, level, np.array(born), np.array(until), NEW)


def pooled(parts: Sequence[Taught], general: Prior) -> Prior:
    """Return the prior that several units, one or more, teach together."""
    columns = zip(*(one.hypotheses for one in parts), strict=True)
    fleet = Hypotheses(*(np.concatenate(column) for column in columns))
    return replace(
        general,
        fleet=fleet,
        fleet_share=len(parts) / (len(parts) + WEIGHT_OF_GENERAL),
        units=len(parts),
        references=References.of([way for one in parts for way in one.ways]),
    )


def with_pace(prior: Prior, followed: Sequence[str], others: Sequence[Evidence]) -> Prior:
    """Return the prior that the `followed` units teach with `others` whose pace is learnt.

    The pace is at the mean of the fleet's exponents. Units that teach either count, each once.
    """
    assert prior.fleet is not None  # noqa: S101 - it was pooled
    fellows = Fellows(others, NEW, prior.reference, prior.fleet.exponents.mean(axis=0))
    return replace(prior, units=len({*followed, *(one.unit for one in others)}), fellows=fellows)


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
