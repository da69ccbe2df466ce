"""The prior of a unit from the other units of its part number: which of them count, and how."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from emaphm.prognosis.evidence import Evidence
from emaphm.prognosis.from_fleet.learning import (
    FEWEST_DIAGNOSES,
    UnitHypotheses,
    fleet_mixture,
    hypotheses_of_unit,
    with_fleet_pace,
)
from emaphm.prognosis.from_fleet.recalibration import Recalibration
from emaphm.prognosis.from_fleet.record import record_of
from emaphm.prognosis.prior import Prior
from emaphm.prognosis.stress import StressReference

if TYPE_CHECKING:
    from emaphm.actuator import Actuator
    from emaphm.history import History, Unit
    from emaphm.history.views import UnitState

MOST_UNITS = 30
"""Units that are followed."""

MOST_PACE_UNITS = 100
"""Units whose pace is learnt, from their diagnoses alone: that costs less than to follow them, and more units
give better forecasts (docs/fleet.md)."""


@dataclass(frozen=True, eq=False)
class Fleet:
    """The units of a part number that a prior is made from, chosen before any of them is left out.

    So all units use the same ones, at the same reference stress: a process that makes one prognosis after
    the other follows each of them once, and learns their pace once for all units that are none of them.

    Attributes
    ----------
    followed
        Units that are followed by the filter, one more than a unit uses, as it may be one of them.
    pace_units
        Units whose pace is learnt, one more in the same way.
    seed
        Source of all randomness.
    hypotheses
        Hypotheses of units, by name, where known; those of the others are computed when needed.
    """

    followed: tuple[Evidence, ...]
    pace_units: tuple[Evidence, ...]
    seed: int
    hypotheses: Mapping[str, UnitHypotheses] = field(default_factory=dict)

    @classmethod
    def of(cls, units: Sequence[Evidence], seed: int) -> "Fleet":
        """Return the fleet of these `units`."""
        evidence = {one.unit: one for one in units}
        explained = {name: len(one.used) for name, one in evidence.items()}
        return cls._chosen(explained, evidence.__getitem__, seed)

    @classmethod
    def read(
        cls, history: "History", lines: "Sequence[UnitState]", seed: int, most: int | None = None
    ) -> "Fleet":
        """Return the fleet of the units of a history that `lines` are of; only the chosen ones are read.

        At most `most` diagnoses of each are used, all where left out.
        """
        explained = {one.serial_number: one.explained for one in lines}
        return cls._chosen(explained, lambda name: Evidence.of(history.unit(name), most), seed)

    @classmethod
    def _chosen(
        cls, explained: Mapping[str, int], evidence_of: Callable[[str], Evidence], seed: int
    ) -> "Fleet":
        followed, pace_units = _chosen_units(explained)
        evidence = {name: evidence_of(name) for name in {*followed, *pace_units}}
        return cls(
            tuple(evidence[name] for name in followed), tuple(evidence[name] for name in pace_units), seed
        )

    @cached_property
    def general(self) -> Prior:
        """The prior without a fleet, at the stress that its units saw on the median, rounded."""
        found = StressReference.of([piece for one in self.followed for piece in one.stresses])
        return Prior(reference=None if found is None else found.rounded())

    def prior_of(self, unit: str, actuator: "Actuator | None" = None) -> Prior:
        """Return the prior of a unit from the others; the general one where none of them is usable.

        Errors as in `fleet_prior`.

        Parameters
        ----------
        unit
            Its serial number, whether it is one of the fleet or not.
        actuator
            Its requirements say when a unit has failed. Forecasts are not corrected by those of failed units
            where left out.
        """
        others = [one for one in self._usable if one.unit != unit][:MOST_UNITS]
        if not others:
            return self.general
        pace_units = [one for one in self.pace_units if one.unit != unit][:MOST_PACE_UNITS]
        prior = fleet_mixture([self._hypotheses_of(one) for one in others], self.general)
        prior = with_fleet_pace(prior, [one.unit for one in others], pace_units)
        record = None if actuator is None else self._record(actuator)
        return prior if record is None else replace(prior, recalibration=record.without(unit))

    @property
    def _usable(self) -> list[Evidence]:
        return [one for one in self.followed if len(one.used) >= FEWEST_DIAGNOSES]

    def _hypotheses_of(self, unit: Evidence) -> UnitHypotheses:
        return self.hypotheses.get(unit.unit) or hypotheses_of_unit(unit, self.general, self.seed)

    def _record(self, actuator: "Actuator") -> Recalibration | None:
        """Return how predictions of those units turned out that failed, each from the others that failed.

        Units that still work say nothing here, so that their next diagnosis changes nothing of it.
        """
        failed = [one for one in self._usable if one.failures]
        parts = [self._hypotheses_of(one) for one in failed]

        def by_others(i: int) -> Prior:
            return fleet_mixture([*parts[:i], *parts[i + 1 :]], self.general)

        about = self.general.settings, self.general.reference
        record = record_of(failed, by_others, about, actuator, self.seed)
        return None if record is None else replace(record, failed_share=len(failed) / len(self._usable))


def fleet_prior(
    units: Sequence[Evidence],
    *,
    unit: str = "",
    seed: int = 0,
    actuator: "Actuator | None" = None,
) -> Prior:
    """Return the prior of a unit, given the others of its part number; the general one without any.

    Each of the others is followed from the general prior; draws from what is then believed of it, all units
    alike, are what the new unit may be: its hypothesis is one of theirs with probability n / (n + 2), n being
    their number, else of the general prior. A rate is taken back to the new component's by its law. This is
    an empirical Bayes estimate of the distribution over units, which is wider than it by each unit's own
    uncertainty.

    Parameters
    ----------
    units
        Diagnoses and replacements of each; one with fewer than `FEWEST_DIAGNOSES` explained ones is left out.
        The unit itself may be among them, as it is in a history: it does not count, but the stress
        that it saw counts for the reference.
    unit
        Its serial number, where it is among them.
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
    return Fleet.of(units, seed).prior_of(unit, actuator)


def learnt_prior(
    history: "History",
    unit: "Unit",
    *,
    seed: int = 0,
    most: int | None = None,
    actuator: "Actuator | None" = None,
) -> Prior:
    """Return the `fleet_prior` of a unit, by the others of its part number in its history.

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
    fleet = Fleet.read(history, history.states(unit.part_number), seed, most)
    return fleet.prior_of(unit.serial_number, actuator or unit.actuator)


def _chosen_units(explained: Mapping[str, int]) -> tuple[list[str], list[str]]:
    """Return the units to follow and those whose pace is learnt, by their numbers of explained diagnoses.

    One more of each than a unit uses, as it may be one of them.
    """
    usable = [name for name, count in explained.items() if count >= FEWEST_DIAGNOSES]
    ordered = sorted(usable, key=lambda name: (-explained[name], name))
    return _evenly(ordered, MOST_UNITS + 1), _evenly(ordered, MOST_PACE_UNITS + 1)


def _evenly(ordered: list[str], most: int) -> list[str]:
    """Return at most `most` of what is ordered by its number of diagnoses, from all of its range.

    Those with most diagnoses alone would be those that live longest: a biased choice.
    """
    if len(ordered) <= most:
        return ordered
    return [ordered[i] for i in np.linspace(0, len(ordered) - 1, most).astype(int)]
