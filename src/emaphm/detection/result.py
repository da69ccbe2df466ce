"""Result of the detector for a cycle or a run: its distance from healthy, and the contributions to it."""

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from emaphm.detection.level import level_name
from emaphm.recording.schema import SCHEMA
from emaphm.text_table import format_table, with_digits

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_ROWS = 8
"""Number of the largest contributions in the table."""

ANOTHER_LOAD = "; no load was recorded, and another load than that of the healthy runs has the same effect"
"""Addition to the verdict "not like healthy" if the load is not known."""


@dataclass(frozen=True)
class Contribution:
    """Contribution of a feature of a channel in a segment to T² and to Q."""

    channel: str
    segment: str
    stroke: str
    feature: str
    t2: float
    q: float


@dataclass(frozen=True)
class Nearest:
    """The seeded fault with the largest `share` of a deviation; `alike` if this is enough to name it."""

    fault: str
    share: float
    alike: bool


@dataclass(frozen=True)
class DetectorResult:
    """Distance of a cycle, or of the mean of several, from healthy cycles of the same manoeuvre and load.

    Attributes
    ----------
    cycles
        Number of cycles that were judged together.
    cycles_alarming
        Number of these cycles that, judged singly, are not like healthy.
    level_cycles
        Level with the largest excess: 1 for the scatter of single cycles, otherwise the least number of
        cycles of the means.
    t2, q, t2_threshold, q_threshold
        The statistics and their thresholds: a healthy cycle exceeds one of the two with the probability
        `false_alarm_rate`.
    contributions
        Contributions to T² and Q by channel, segment and feature; none is negative, their sums are T² and Q.
    nearest
        The nearest seeded fault; None if the detector has none.
    false_alarm_rate
        Rate of false alarms for which the thresholds are computed.
    shown
        Sentence on the rate of false alarms that the healthy runs show.
    load_recorded
        Whether all cycles have a recorded load; otherwise another load may be the cause of a deviation.
    """

    recording: str
    cycles: int
    cycles_alarming: int
    level_cycles: int
    manoeuvre: str
    t2: float
    q: float
    t2_threshold: float
    q_threshold: float
    contributions: tuple[Contribution, ...]
    nearest: Nearest | None
    false_alarm_rate: float
    shown: str
    load_recorded: bool = True

    @property
    def like_healthy(self) -> bool:
        """Whether neither statistic exceeds its threshold."""
        return self.t2 <= self.t2_threshold and self.q <= self.q_threshold

    @property
    def excess(self) -> float:
        """The larger of T² and Q, each relative to its threshold."""
        return max(self.t2 / self.t2_threshold, self.q / self.q_threshold)

    @property
    def by_channel(self) -> dict[str, float]:
        """Share of each channel in the statistic that exceeds its threshold most."""
        return self._shares("channel")

    @property
    def by_segment(self) -> dict[str, float]:
        """Share of each segment in the statistic that exceeds its threshold most."""
        return self._shares("segment")

    @property
    def by_feature(self) -> dict[str, float]:
        """Share of each kind of feature in the statistic that exceeds its threshold most."""
        return self._shares("feature")

    @property
    def sentence(self) -> str:
        """The verdict in one sentence, without a full stop."""
        t2, q = self.t2 / self.t2_threshold, self.q / self.q_threshold
        if self.like_healthy:
            sizes = f"T² {with_digits(t2)}, Q {with_digits(q)} × threshold"
            return f"like healthy ({sizes}{self._level_clause}){self._alarms_clause}"
        size = f"Q {with_digits(q)} × threshold" if q >= t2 else f"T² {with_digits(t2)} × threshold"
        channel, stroke, share = self._largest_share()
        place = f"in the {stroke}" if stroke == "hold" else f"on the {stroke}"
        where = f"{_channel_name(channel)} {place} ({100 * share:.0f} %)"
        text = f"not like healthy ({size}{self._level_clause}), mostly {where}"
        if self.nearest is not None and self.nearest.alike:
            text += f"; nearest seeded fault: {self.nearest.fault} ({100 * self.nearest.share:.0f} %)"
        elif self.nearest is not None:
            text += "; like none of the seeded faults"
        return text if self.load_recorded else f"{text}{ANOTHER_LOAD}"

    def to_dict(self) -> dict[str, Any]:
        """Return the values that `--json` prints under "detector"."""
        return {
            "recording": self.recording,
            "cycles": self.cycles,
            "cycles_alarming": self.cycles_alarming,
            "level_cycles": self.level_cycles,
            "manoeuvre": self.manoeuvre,
            "load_recorded": self.load_recorded,
            "like_healthy": self.like_healthy,
            "sentence": self.sentence,
            "t2": self.t2,
            "q": self.q,
            "t2_threshold": self.t2_threshold,
            "q_threshold": self.q_threshold,
            "by_channel": self.by_channel,
            "by_segment": self.by_segment,
            "by_feature": self.by_feature,
            "contributions": [
                {
                    "channel": contribution.channel,
                    "segment": contribution.segment,
                    "feature": contribution.feature,
                    "t2": contribution.t2,
                    "q": contribution.q,
                }
                for contribution in self.contributions
            ],
            "nearest": None
            if self.nearest is None
            else {"fault": self.nearest.fault, "share": self.nearest.share, "alike": self.nearest.alike},
            "false_alarm_rate": self.false_alarm_rate,
            "shown": self.shown,
        }

    def to_json(self) -> str:
        """Return the result as JSON."""
        return json.dumps(self.to_dict(), indent=2)

    def plot(self) -> "Figure":
        """Draw T² and Q against their thresholds, and the contributions by channel and segment."""
        from emaphm.plotting.detection import draw_detection

        return draw_detection(self)

    def __str__(self) -> str:
        """Return the verdict, the largest contributions, and the rate of false alarms of the thresholds."""
        total = self._total()
        largest = sorted(self.contributions, key=self._value, reverse=True)[:MOST_ROWS]
        rows = [
            (item.channel, item.segment, item.feature, f"{100 * self._value(item) / total:.1f} %")
            for item in largest
        ]
        statistic = "Q" if self._q_exceeds_most() else "T²"
        lines = [f"{self.recording}: {self.sentence}."]
        if not self.like_healthy:
            lines.append(format_table(["channel", "segment", "feature", f"share of {statistic}"], rows))
        rate = f"{100 * self.false_alarm_rate:g} % of false alarms, for {level_name(self.level_cycles)}"
        return "\n".join([*lines, f"Thresholds for {rate}. {self.shown}."])

    @property
    def _level_clause(self) -> str:
        """The clause that a mean was judged by the scatter of single cycles; else empty."""
        if self.cycles == 1 or self.level_cycles > 1:
            return ""
        return f", {self.cycles} cycles by the scatter of single ones"

    @property
    def _alarms_clause(self) -> str:
        """The clause on the number of cycles with an alarm in a run that is like healthy; else empty."""
        if self.cycles == 1 or not self.cycles_alarming:
            return ""
        return f", but {self.cycles_alarming} of {self.cycles} cycles alarm singly"

    def _q_exceeds_most(self) -> bool:
        return self.q / self.q_threshold >= self.t2 / self.t2_threshold

    def _value(self, contribution: Contribution) -> float:
        return contribution.q if self._q_exceeds_most() else contribution.t2

    def _total(self) -> float:
        return sum(map(self._value, self.contributions)) or 1.0

    def _shares(self, by: str) -> dict[str, float]:
        shares: dict[str, float] = {}
        total = self._total()
        for contribution in self.contributions:
            name = getattr(contribution, by)
            shares[name] = shares.get(name, 0.0) + self._value(contribution) / total
        return shares

    def _largest_share(self) -> tuple[str, str, float]:
        """Return the pair of channel and kind of stroke with the largest contribution, and its share."""
        shares: dict[tuple[str, str], float] = {}
        total = self._total()
        for contribution in self.contributions:
            pair = (contribution.channel, contribution.stroke)
            shares[pair] = shares.get(pair, 0.0) + self._value(contribution) / total
        pair = max(shares, key=lambda key: shares[key])
        return *pair, shares[pair]


def _channel_name(channel: str) -> str:
    return "current" if channel == "current_A" else SCHEMA[channel].meaning
