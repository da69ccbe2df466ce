"""How many false alarms are to be expected in 1,000 flight hours."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

HOURS = 1000.0


@dataclass(frozen=True)
class FalseAlarmRate:
    """False alarms in 1,000 flight hours of a healthy unit, at most.

    With the share p of healthy recordings that are called degraded, the share q of recordings that decide
    (p of them falsely, whatever the others say: they do not interrupt a succession), r recordings an hour,
    and an alarm after k decided ones in succession, it is

        1000 r q (p/q)^k   where false verdicts come independently of each other; p/q is 1 at most,
        1000 r p           where one is always followed by another: an alarm cannot begin more often.

    Attributes
    ----------
    per_recording
        p.
    recordings_per_hour
        r, None where it is not known yet.
    raise_after
        k.
    decided
        q, above 0.
    """

    per_recording: float
    recordings_per_hour: float | None
    raise_after: int
    decided: float = 1.0

    @property
    def independent(self) -> float | None:
        """False alarms in 1,000 h where false verdicts come independently."""
        false = min(self.per_recording / self.decided, 1.0)
        return self._in_hours(self.per_recording * false ** (self.raise_after - 1))

    @property
    def together(self) -> float | None:
        """False alarms in 1,000 h where false verdicts come together."""
        return self._in_hours(self.per_recording)

    def to_dict(self) -> dict[str, Any]:
        """Return the rate in the form of the details of an event."""
        return {
            "per_recording_at_most": self.per_recording,
            "recordings_per_hour": self.recordings_per_hour,
            "raise_after": self.raise_after,
            "decided_share": self.decided,
            "per_1000_h_if_independent": self.independent,
            "per_1000_h_if_together": self.together,
        }

    def _in_hours(self, per_recording: float) -> float | None:
        rate = self.recordings_per_hour
        return None if rate is None else HOURS * rate * per_recording


def recordings_per_hour(hours: Sequence[float]) -> float | None:
    """Return how many recordings there are an hour of flight, of their hours in order; None where unknown."""
    if len(hours) < 2 or not hours[-1] > hours[0]:
        return None
    return (len(hours) - 1) / (hours[-1] - hours[0])
