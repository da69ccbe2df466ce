"""Prior of a unit from the other units of its part number: selection of the units and their use."""

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
from emaphm.prognosis.from_fleet.missions import Missions
from emaphm.prognosis.from_fleet.recalibration import Recalibration
from emaphm.prognosis.from_fleet.record import record_of
from emaphm.prognosis.prior import Prior
from emaphm.prognosis.stress import StressReference

if TYPE_CHECKING:
    from emaphm.actuator import Actuator
    from emaphm.history import History, Unit
    from emaphm.history.views import UnitState

MOST_UNITS = 30
"""Largest number of units that are followed by the filter."""

MOST_PACE_UNITS = 100
"""Largest number of units whose pace is learnt from their diagnoses. This costs less than the filter, and
more units give better forecasts (docs/fleet.md)."""


@dataclass(frozen=True, eq=False)
class Fleet:
    """The units of a part number for a prior, selected before any unit is left out.

    All units therefore use the same selection and the same reference stress: a process that computes several
    prognoses follows each selected unit once, and learns their pace once for all units outside the selection.

    Attributes
    ----------
    followed
        Units that are followed by the filter, one more than a prior uses, because the unit itself may be
        among them.
    pace_units
        Units whose pace is learnt, one more for the same reason.
    seed
        Seed of the random streams.
    hypotheses
        Hypotheses by unit, if already computed; missing ones are computed when needed.
    """

    followed: tuple[Evidence, ...]
    pace_units: tuple[Evidence, ...]
    seed: int
    hypotheses: Mapping[str, UnitHypotheses] = field(default_factory=dict)

    @classmethod
    def of(cls, units: Sequence[Evidence], seed: int) -> "Fleet":
        """Return the fleet of these `units`."""
        evidence = {unit.unit: unit for unit in units}
        explained = {name: len(unit.used) for name, unit in evidence.items()}
        return cls._selected(explained, evidence.__getitem__, seed)

    @classmethod
    def read(
        cls, history: "History", lines: "Sequence[UnitState]", seed: int, most: int | None = None
    ) -> "Fleet":
        """Return the fleet of the units `lines` of a history; only the selected units are read.

        At most `most` diagnoses of each unit are used, by default all.
        """
        explained = {unit.serial_number: unit.explained for unit in lines}
        return cls._selected(explained, lambda name: Evidence.of(history.unit(name), most), seed)

    @classmethod
    def _selected(
        cls, explained: Mapping[str, int], evidence_of: Callable[[str], Evidence], seed: int
    ) -> "Fleet":
        followed, pace_units = _chosen_units(explained)
        evidence = {name: evidence_of(name) for name in {*followed, *pace_units}}
        return cls(
            tuple(evidence[name] for name in followed), tuple(evidence[name] for name in pace_units), seed
        )

    @cached_property
    def general(self) -> Prior:
        """The prior without a fleet, with the rounded median of its units' stress as reference."""
        stresses = [unit.stresses for unit in self.followed]
        reference = StressReference.of([piece for pieces in stresses for piece in pieces])
        if reference is None:
            return Prior()
        rounded = reference.rounded()
        return Prior(reference=rounded, missions=Missions.of(stresses, rounded))

    def prior_of(self, unit: str, actuator: "Actuator | None" = None) -> Prior:
        """Return the prior of a unit from the other units; the general prior if none of them is usable.

        Errors as in `fleet_prior`.

        Parameters
        ----------
        unit
            Serial number of the unit, which may be in the fleet or not.
        actuator
            Actuator whose requirements define a failure. Without it, forecasts are not recalibrated by those
            of failed units.
        """
        others = [other for other in self._usable if other.unit != unit][:MOST_UNITS]
        if not others:
            return self.general
        pace_units = [other for other in self.pace_units if other.unit != unit][:MOST_PACE_UNITS]
        prior = fleet_mixture([self._hypotheses_of(other) for other in others], self.general, self.seed)
        prior = with_fleet_pace(prior, [other.unit for other in others], pace_units)
        record = None if actuator is None else self._record(actuator)
        return prior if record is None else replace(prior, recalibration=record.without(unit))

    @property
    def _usable(self) -> list[Evidence]:
        return [unit for unit in self.followed if len(unit.used) >= FEWEST_DIAGNOSES]

    def _hypotheses_of(self, unit: Evidence) -> UnitHypotheses:
        return self.hypotheses.get(unit.unit) or hypotheses_of_unit(unit, self.general, self.seed)

    def _record(self, actuator: "Actuator") -> Recalibration | None:
        """Return the outcomes of predictions of the failed units, each from the other failed units.

        Units that still work are not used, so that their next diagnosis does not change the outcomes.
        """
        failed = [unit for unit in self._usable if unit.failures]
        parts = [self._hypotheses_of(unit) for unit in failed]

        def by_others(i: int) -> Prior:
            return fleet_mixture([*parts[:i], *parts[i + 1 :]], self.general, self.seed)

        general = self.general
        about = general.settings, general.reference, general.missions.reference_weight
        record = record_of(failed, by_others, about, actuator, self.seed)
        return None if record is None else replace(record, failed_share=len(failed) / len(self._usable))


def fleet_prior(
    units: Sequence[Evidence],
    *,
    unit: str = "",
    seed: int = 0,
    actuator: "Actuator | None" = None,
) -> Prior:
    """Return the prior of a unit from the other units of its part number; the general prior without any.

    Each of the other units is followed from the general prior, and contributes an equal number of draws from
    its posterior. With probability n / (n + 2), n being the number of units, a hypothesis of the new unit is
    one of these draws, otherwise it is drawn from the general prior. A rate is converted to that of the new
    component according to its law. This is an empirical Bayes estimate of the distribution over units, wider
    than this distribution by each unit's own uncertainty.

    Parameters
    ----------
    units
        Diagnoses and replacements of each unit; units with fewer than `FEWEST_DIAGNOSES` explained diagnoses
        are left out. The unit itself may be among them, as in a history: only its stress is used, for the
        reference.
    unit
        Serial number of the unit, if it is among them.
    seed
        Seed of the random streams.
    actuator
        Actuator whose requirements define a failure, for the recalibration of forecasts by the outcomes for
        failed units. Without it, forecasts are not recalibrated.

    Raises
    ------
    PrognosisError
        A diagnosis of one of the other units cannot be used.
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
    """Return the `fleet_prior` of a unit, from the other units of its part number in its history.

    Parameters
    ----------
    history, unit
        The open history, and a unit of it, `history.unit(serial_number)`.
    seed
        Seed of the random streams.
    most
        Largest number of diagnoses used of each other unit; by default all.
    actuator
        Actuator whose requirements define a failure; by default that of the unit's last diagnosis.

    Raises
    ------
    PrognosisError
        A diagnosis of one of the other units cannot be used.
    HistoryError
        The database fails.
    """
    fleet = Fleet.read(history, history.states(unit.part_number), seed, most)
    return fleet.prior_of(unit.serial_number, actuator or unit.actuator)


def _chosen_units(explained: Mapping[str, int]) -> tuple[list[str], list[str]]:
    """Return the units to follow and those whose pace is learnt, from the numbers of explained diagnoses.

    Both have one more unit than a prior uses, because the unit itself may be among them.
    """
    usable = [name for name, count in explained.items() if count >= FEWEST_DIAGNOSES]
    ordered = sorted(usable, key=lambda name: (-explained[name], name))
    return _evenly(ordered, MOST_UNITS + 1), _evenly(ordered, MOST_PACE_UNITS + 1)


def _evenly(ordered: list[str], most: int) -> list[str]:
    """Return at most `most` units, evenly spaced in the order by number of diagnoses.

    A selection of the units with most diagnoses would be biased to long lives.
    """
    if len(ordered) <= most:
        return ordered
    return [ordered[i] for i in np.linspace(0, len(ordered) - 1, most).astype(int)]
