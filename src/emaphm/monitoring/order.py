"""Events on recordings whose hours do not increase with their arrival, since some hours may be wrong."""

from collections.abc import Sequence
from dataclasses import dataclass

import sqlalchemy as sa

from emaphm.history import Event
from emaphm.history.reading import UnitRow, hours_last_added, latest_entry
from emaphm.monitoring.conditions import Situation

IN_SUCCESSION = 3
"""Number of last added recordings, of increasing hours below the unit's latest hours, that raises the
event."""


@dataclass(frozen=True)
class Arrivals:
    """The latest hours of a unit [h], the kind of entry with them, and the hours last added [h]."""

    latest: float
    entry: str
    added: Sequence[float]

    @classmethod
    def of(cls, connection: sa.Connection, unit: UnitRow) -> "Arrivals":
        """Return the arrivals of a unit, read from the history through `connection`."""
        added = hours_last_added(connection, unit.id, IN_SUCCESSION)
        return cls(*latest_entry(connection, unit.id), added)

    @property
    def are_behind(self) -> bool:
        """Whether the hours last added increase, as for new recordings, but are below the latest hours."""
        is_increasing = all(a < b for a, b in zip(self.added, self.added[1:], strict=False))
        return len(self.added) == IN_SUCCESSION and is_increasing and self.added[-1] < self.latest


def hours_events(now: Situation, arrivals: Arrivals) -> list[Event]:
    """Return the event that raises or clears "hours_behind", if any: such recordings raise no alarm."""
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
