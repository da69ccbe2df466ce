"""What is said where the hours of recordings do not rise with their arrival: some hours may be wrong."""

from collections.abc import Sequence
from dataclasses import dataclass

import sqlalchemy as sa

from emaphm.history import Event
from emaphm.history.reading import UnitRow, hours_last_added, latest_entry
from emaphm.monitoring.conditions import Situation

IN_SUCCESSION = 3
"""Recordings added last, of rising hours and all behind the unit's latest hours, from which on it is said."""


@dataclass(frozen=True)
class Arrivals:
    """The latest hours of a unit [h], the entry that has them, and the hours of what was added last [h]."""

    latest: float
    entry: str
    added: Sequence[float]

    @classmethod
    def of(cls, connection: sa.Connection, unit: UnitRow) -> "Arrivals":
        """Return those of a unit of the history that `connection` reads."""
        added = hours_last_added(connection, unit.id, IN_SUCCESSION)
        return cls(*latest_entry(connection, unit.id), added)

    @property
    def are_behind(self) -> bool:
        """Whether the latest hours contradict what was added last, which rises as if it were the present."""
        rising = all(one < other for one, other in zip(self.added, self.added[1:], strict=False))
        return len(self.added) == IN_SUCCESSION and rising and self.added[-1] < self.latest


def hours_events(now: Situation, arrivals: Arrivals) -> list[Event]:
    """Return the event that hours are behind, or no longer: recordings behind them may raise no alarm."""
    is_open = now.opened("hours_behind") is not None
    if is_open and now.new.hours >= arrivals.latest:
        return [now.event("hours_behind", "cleared", "info", "recordings have the latest hours again")]
    if is_open or not arrivals.are_behind:
        return []
    first, last = arrivals.added[0], arrivals.added[-1]
    message = (
        f"the last {len(arrivals.added)} recordings, of {first:.9g} to {last:.9g} h, lie behind a "
        f"{arrivals.entry} at {arrivals.latest:.9g} h, so that alarms can be missing; if those hours are "
        "wrong, 'emaphm history withdraw' takes it out"
    )
    return [
        now.event(
            "hours_behind",
            "raised",
            "warning",
            message,
            latest_hours=arrivals.latest,
            entry=arrivals.entry,
        )
    ]
