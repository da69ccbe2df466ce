"""Expected number of false alarms in 1,000 flight hours."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

HOURS = 1000.0


@dataclass(frozen=True)
class FalseAlarmRate:
    """Upper limit of the number of false alarms in 1,000 flight hours of a healthy unit.

    With the share p of healthy recordings that are diagnosed as degraded, the share q of decided recordings
    (undecided recordings do not interrupt a succession), r recordings per hour, and an alarm after k
    successive degraded verdicts, it is

        1000 r q (p/q)^k   if false verdicts are independent; p/q is at most 1,
        1000 r p           if false verdicts occur in succession: an alarm cannot begin more often.

    Attributes
    ----------
    per_recording
        p, share of healthy recordings with a false verdict.
    recordings_per_hour
        r, None if it is not known yet.
    raise_after
        k, number of successive verdicts.
    decided
        q, share of decided recordings, above 0.
    """

    per_recording: float
    recordings_per_hour: float | None
    raise_after: int
    decided: float = 1.0

    @property
    def independent(self) -> float | None:
        """False alarms in 1,000 h if false verdicts are independent, None if the rate is not known."""
        false = min(self.per_recording / self.decided, 1.0)
        return self._in_hours(self.per_recording * false ** (self.raise_after - 1))

    @property
    def together(self) -> float | None:
        """False alarms in 1,000 h if false verdicts occur in succession, None if the rate is not known."""
        return self._in_hours(self.per_recording)

    def to_dict(self) -> dict[str, Any]:
        """Return the rate as a mapping for the details of an event."""
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
    """Return the number of recordings per flight hour from their `hours` in order, None if it is unknown."""
    if len(hours) < 2 or not hours[-1] > hours[0]:
        return None
    return (len(hours) - 1) / (hours[-1] - hours[0])
