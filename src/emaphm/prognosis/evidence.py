"""What a history says of a unit's degradation: its diagnoses, replacements, failures and stress."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.arrays import Array
from emaphm.prognosis.bounds import COORDINATES
from emaphm.prognosis.columns import columns_of
from emaphm.prognosis.laws import Mask
from emaphm.prognosis.stress import Stress, StressPiece

if TYPE_CHECKING:
    from collections.abc import Sequence

    from emaphm.history import Failure, Flight, Unit
    from emaphm.history.lives import OpenRemoval


@dataclass(frozen=True, eq=False)
class Observation:
    """A diagnosis at flight `hours` [h]: levels (8,), covariance (8, 8), which components it saw (8,).

    In the coordinates `CARTESIAN_NAMES`. One that is not `explained` is shown and not used. `shared` is the
    part of the covariance that all diagnoses of the unit have in common, (8, 8), or 0; `load` what the
    diagnosis estimated with the faults, None where it did not.
    """

    hours: float
    level: Array
    covariance: Array
    seen: Mask
    explained: bool = True
    shared: Array | float = 0.0
    load: float | None = None


@dataclass(frozen=True, eq=False)
class Evidence:
    """What is known of a unit: its flight hours now [h], its observations by hours, its replacements.

    `replacements` are pairs of hours [h] and component, "unit" standing for all of them; `stresses` what the
    unit was subject to, by hours. Observations are of the first `components`: all 8, or one for an indicator.
    `failures` are the hours [h] at which failures ended lives of the unit, rising; `unrepaired` is the one
    for which it is out of service now, None where it is in service. `not_replaced` are failures of components
    of which no replacement is known, and `open_removal` is one as failed of which a shop has named only what
    has not failed: the unit counts as in service all the same. `contradictions` are notes on findings that
    its diagnoses contradict, `description_notes` on a description unlike other units'.
    """

    unit: str
    part_number: str
    hours: float
    observations: tuple[Observation, ...] = ()
    replacements: tuple[tuple[float, str], ...] = ()
    stresses: tuple[StressPiece, ...] = ()
    components: int = COORDINATES
    failures: tuple[float, ...] = ()
    unrepaired: "Failure | None" = None
    not_replaced: "tuple[Failure, ...]" = ()
    open_removal: "OpenRemoval | None" = None
    contradictions: tuple[str, ...] = ()
    description_notes: tuple[str, ...] = ()

    @classmethod
    def of(cls, unit: "Unit", most: int | None = None) -> "Evidence":
        """Return what a history says of `unit`; `HistoryError` where its database fails.

        `most` is how many of its diagnoses are taken at most: half of them the latest, half from the hours
        before, evenly spread, which show how it has come to where it is.
        """
        earlier = 0 if most is None else most // 2
        diagnoses = unit.diagnoses(None if most is None else most - earlier, earlier)
        observations = tuple(
            Observation(
                one.hours,
                one.cartesian,
                one.cartesian_covariance,
                np.array([name in one.coordinates for name in CARTESIAN_NAMES]),
                one.explained,
                one.cartesian_shared_covariance,
                one.estimated_load,
            )
            for one in diagnoses
        )
        from emaphm.history.lives import latest_hours, lives, not_replaced, open_removal, unrepaired
        from emaphm.history.notes.contradictions import contradictions

        flights, removals, findings = unit.flights(), unit.removals(), unit.findings()
        replacements = tuple((one.hours, one.component) for one in findings if one.replaced)
        failure = unrepaired(flights, removals, findings)
        return cls(
            unit.serial_number,
            unit.part_number,
            latest_hours(flights, removals, findings),
            observations,
            replacements,
            stress_pieces(flights),
            failures=tuple(one.end_hours for one in lives(flights, removals, findings) if one.failed),
            unrepaired=failure,
            not_replaced=() if failure else not_replaced(findings),
            open_removal=None if failure else open_removal(flights, removals, findings),
            contradictions=contradictions(diagnoses, findings),
            description_notes=unit.description_notes(),
        )

    @property
    def unexplained(self) -> tuple[float, float] | None:
        """Hours [h] of the first and the last of the newest diagnoses, none of which is explained.

        None where one of the newest hours is explained, or a part is newer.
        """
        explained = max((one.hours for one in self.used), default=-np.inf)
        hours = [one.hours for one in self.observations if one.hours > explained]
        if not hours or any(at >= max(hours) for at, _ in self.replacements):
            return None
        return min(hours), max(hours)

    @property
    def used(self) -> tuple[Observation, ...]:
        """The observations that the model explains."""
        return tuple(one for one in self.observations if one.explained)

    @property
    def seen(self) -> Mask:
        """Which components any used observation has seen, (8,) of True and False."""
        if not self.used:
            return np.ones(self.components, bool)
        return np.asarray(np.any([one.seen for one in self.used], axis=0))

    @property
    def shared(self) -> Array:
        """Covariance of the error that all observations have in common, (8, 8): the mean of those used."""
        none = np.zeros((self.components, self.components))
        return np.mean([none + one.shared for one in self.used], axis=0) if self.used else none

    @property
    def failed_lives(self) -> tuple[tuple[float, float], ...]:
        """From which flight hours on [h] the unit worked as it was until it failed, and when: each failure.

        A life begins when anything of the unit was replaced: what was to fail before may have been that.
        """
        renewed = {*self.failures, *(hours for hours, _ in self.replacements)}
        return tuple(
            (max((one for one in renewed if one < end), default=-np.inf), end) for end in self.failures
        )

    def lives(self, column: int) -> tuple[tuple[float, float], ...]:
        """Return from when to when [h] each component of a `column` was in the unit, the last to `inf`."""
        ends = sorted({hours for hours, what in self.replacements if column in columns_of(what)})
        return tuple(zip([0.0, *ends], [*ends, np.inf], strict=True))


def stress_pieces(flights: "Sequence[Flight]") -> tuple[StressPiece, ...]:
    """Return the stress between one of a unit's flights and the next, as the later one says.

    Loads and temperatures are what was recorded; cycles per hour follow from cycles and hours.
    """
    pieces: list[StressPiece] = []
    start = 0.0
    for flight, per_hour in zip(flights, _cycles_per_hour(flights), strict=True):
        stress = Stress(flight.load, flight.temperature, per_hour)
        if flight.hours > start and any(x is not None for x in stress.values):
            pieces.append(StressPiece(start, flight.hours, stress))
        start = flight.hours
    return tuple(pieces)


def _cycles_per_hour(flights: "Sequence[Flight]") -> list[float | None]:
    """Return the cycles per hour before each of a unit's flights: since those that were last stated."""
    rates: list[float | None] = [None] * len(flights)
    first, then, start = 0, 0, 0.0
    for i, flight in enumerate(flights):
        if flight.cycles is None:
            continue
        if flight.hours > start:
            rate = (flight.cycles - then) / (flight.hours - start)
            rates[first : i + 1] = [rate] * (i + 1 - first)
        first, then, start = i + 1, flight.cycles, flight.hours
    return rates
