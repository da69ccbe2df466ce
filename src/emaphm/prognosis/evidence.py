"""Evidence on a unit's degradation from its history: diagnoses, replacements, failures and stress."""

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
    """A diagnosis at flight `hours` [h]: levels (8,), covariance (8, 8), mask of estimated components (8,).

    The coordinates are `CARTESIAN_NAMES`. An observation that is not `explained` is plotted and not used.
    `shared` is the part of the covariance that all diagnoses of the unit have in common, (8, 8), or 0. `load`
    is the load that was estimated with the faults, None if it was not estimated.
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
    """Evidence on a unit: its current flight hours [h], its observations by hours, its replacements.

    `replacements` are pairs of hours [h] and component, where "unit" means all components. `stresses` are the
    recorded stresses by hours. Observations have the first `components`: all 8, or one for an indicator.
    `failures` are the hours [h] at which failures ended lives of the unit, increasing. `unrepaired` is the
    failure that has put the unit out of service, None if the unit is in service. `not_replaced` are failures
    of components without a known replacement. `open_removal` is a removal as failed for which the shop has
    named only components that have not failed; with either, the unit counts as in service. `contradictions`
    are notes on findings that the diagnoses contradict, `description_notes` on a description that differs
    from those of other units.
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
        """Return the evidence on `unit` from its history; `HistoryError` if the database fails.

        At most `most` diagnoses are used: half of them the latest, half evenly spread over the earlier hours,
        which contain the course of the degradation.
        """
        earlier = 0 if most is None else most // 2
        diagnoses = unit.diagnoses(None if most is None else most - earlier, earlier)
        observations = tuple(
            Observation(
                diagnosis.hours,
                diagnosis.cartesian,
                diagnosis.cartesian_covariance,
                np.array([name in diagnosis.coordinates for name in CARTESIAN_NAMES]),
                diagnosis.explained,
                diagnosis.cartesian_shared_covariance,
                diagnosis.estimated_load,
            )
            for diagnosis in diagnoses
        )
        from emaphm.history.lives import latest_hours, lives, not_replaced, open_removal, unrepaired
        from emaphm.history.notes.contradictions import contradictions

        entries = unit.entries()
        flights, removals, findings = entries.flights, entries.removals, entries.findings
        replacements = tuple((finding.hours, finding.component) for finding in findings if finding.replaced)
        failure = unrepaired(flights, removals, findings)
        return cls(
            unit.serial_number,
            unit.part_number,
            latest_hours(flights, removals, findings),
            observations,
            replacements,
            stress_pieces(flights),
            failures=tuple(life.end_hours for life in lives(flights, removals, findings) if life.failed),
            unrepaired=failure,
            not_replaced=() if failure else not_replaced(findings),
            open_removal=None if failure else open_removal(flights, removals, findings),
            contradictions=contradictions(diagnoses, findings),
            description_notes=unit.description_notes(),
        )

    @property
    def unexplained(self) -> tuple[float, float] | None:
        """Hours [h] of the first and the last diagnosis after the last explained one.

        None if there is no such diagnosis, or if a component was replaced at the last of these hours or
        later.
        """
        explained = max((observation.hours for observation in self.used), default=-np.inf)
        hours = [observation.hours for observation in self.observations if observation.hours > explained]
        if not hours or any(at >= max(hours) for at, _ in self.replacements):
            return None
        return min(hours), max(hours)

    @property
    def used(self) -> tuple[Observation, ...]:
        """The explained observations, which the filter uses."""
        return tuple(observation for observation in self.observations if observation.explained)

    @property
    def flights(self) -> int:
        """Number of flights of the used observations, which differ in hours; a rate needs several."""
        return len({observation.hours for observation in self.used})

    @property
    def seen(self) -> Mask:
        """Mask (8,) of the components that at least one used observation has estimated."""
        if not self.used:
            return np.ones(self.components, bool)
        return np.asarray(np.any([observation.seen for observation in self.used], axis=0))

    @property
    def shared(self) -> Array:
        """Shared covariance (8, 8) of all observations: the mean of that of the used observations."""
        zero = np.zeros((self.components, self.components))
        return (
            np.mean([zero + observation.shared for observation in self.used], axis=0) if self.used else zero
        )

    @property
    def failed_lives(self) -> tuple[tuple[float, float], ...]:
        """Start and end [h] of each life of the unit that ended by a failure.

        A life starts at the last failure, or at the last replacement of any component: the replaced component
        may have been the next to fail.
        """
        renewed = {*self.failures, *(hours for hours, _ in self.replacements)}
        return tuple(
            (max((start for start in renewed if start < end), default=-np.inf), end) for end in self.failures
        )

    def since_replacement(self, column: int) -> tuple[Observation, ...]:
        """Return the used observations that estimated `column`, after its component's last replacement."""
        ends = [hours for hours, component in self.replacements if column in columns_of(component)]
        new_at = max(ends, default=-np.inf)
        return tuple(item for item in self.used if item.hours > new_at and item.seen[column])

    def lives(self, column: int) -> tuple[tuple[float, float], ...]:
        """Return start and end [h] of the lives of a `column`'s component; the last life ends at `inf`."""
        ends = sorted({hours for hours, component in self.replacements if column in columns_of(component)})
        return tuple(zip([0.0, *ends], [*ends, np.inf], strict=True))


def stress_pieces(flights: "Sequence[Flight]") -> tuple[StressPiece, ...]:
    """Return the stress between successive flights of a unit, as recorded with the later flight.

    Loads and temperatures are the recorded values; cycles per hour follow from cycles and hours.
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
    """Return the cycles per hour before each flight of a unit, since the last flight with a cycle count."""
    rates: list[float | None] = [None] * len(flights)
    first, count, start = 0, 0, 0.0
    for i, flight in enumerate(flights):
        if flight.cycles is None:
            continue
        if flight.hours > start:
            rate = (flight.cycles - count) / (flight.hours - start)
            rates[first : i + 1] = [rate] * (i + 1 - first)
        first, count, start = i + 1, flight.cycles, flight.hours
    return rates
