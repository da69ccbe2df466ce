"""What the detector says of a cycle or a run: how far from healthy, and where."""

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from emaphm.detection.level import level_name
from emaphm.recording.schema import SCHEMA
from emaphm.text_table import format_table, with_digits

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_ROWS = 8
"""Contributions in the table, the largest."""

ANOTHER_LOAD = "; no load was recorded, and another load than that of the healthy runs looks like that too"
"""What a recording that is not like healthy may be where its load is not known."""


@dataclass(frozen=True)
class Contribution:
    """What a feature of a channel in a segment adds to T² and to Q."""

    channel: str
    segment: str
    stroke: str
    feature: str
    t2: float
    q: float


@dataclass(frozen=True)
class Nearest:
    """The seeded fault along whose direction a deviation lies most, its share, and if that is enough."""

    fault: str
    share: float
    alike: bool


@dataclass(frozen=True)
class DetectorResult:
    """How far a cycle, or the mean of several, is from healthy ones of the same manoeuvre and load.

    Attributes
    ----------
    cycles
        How many were judged together.
    cycles_alarming
        How many of them are not like healthy singly.
    level_cycles
        By whose scatter they are farthest from healthy: 1, that of single cycles; else that of means of as
        many cycles.
    t2, q, t2_threshold, q_threshold
        The statistics and what a healthy one exceeds with the rate of false alarms in one of the two.
    contributions
        To both, by channel, segment and feature; none below 0, their sums are T² and Q.
    nearest
        Of the seeded faults; None where there are none.
    false_alarm_rate
        What the thresholds are set for.
    shown
        What of it the healthy runs can show.
    load_recorded
        Whether all of the cycles have a recorded load: without, another load is not like healthy either.
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
            return f"like healthy ({sizes}{self._coarse}){self._contradicted}"
        size = f"Q {with_digits(q)} × threshold" if q >= t2 else f"T² {with_digits(t2)} × threshold"
        channel, stroke, share = self._most()
        place = f"in the {stroke}" if stroke == "hold" else f"on the {stroke}"
        text = (
            f"not like healthy ({size}{self._coarse}), mostly {_short(channel)} {place} ({100 * share:.0f} %)"
        )
        if self.nearest is not None and self.nearest.alike:
            text += f"; nearest seeded fault: {self.nearest.fault} ({100 * self.nearest.share:.0f} %)"
        elif self.nearest is not None:
            text += "; like none of the seeded faults"
        return text if self.load_recorded else f"{text}{ANOTHER_LOAD}"

    def to_dict(self) -> dict[str, Any]:
        """Return what `--json` prints under "detector"."""
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
                    "channel": one.channel,
                    "segment": one.segment,
                    "feature": one.feature,
                    "t2": one.t2,
                    "q": one.q,
                }
                for one in self.contributions
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
        """Return the verdict, the largest contributions and what the thresholds rest on."""
        total = self._total()
        largest = sorted(self.contributions, key=self._value, reverse=True)[:MOST_ROWS]
        rows = [
            (one.channel, one.segment, one.feature, f"{100 * self._value(one) / total:.1f} %")
            for one in largest
        ]
        statistic = "Q" if self._by_q() else "T²"
        lines = [f"{self.recording}: {self.sentence}."]
        if not self.like_healthy:
            lines.append(format_table(["channel", "segment", "feature", f"share of {statistic}"], rows))
        rate = f"{100 * self.false_alarm_rate:g} % of false alarms, of {level_name(self.level_cycles)}"
        return "\n".join([*lines, f"Thresholds for {rate}. {self.shown}."])

    @property
    def _coarse(self) -> str:
        """Return that it was the scatter of single cycles that judged a mean, or nothing."""
        if self.cycles == 1 or self.level_cycles > 1:
            return ""
        return f", {self.cycles} cycles by the scatter of single ones"

    @property
    def _contradicted(self) -> str:
        """Return how many cycles of a run that is like healthy are not so singly, or nothing."""
        if self.cycles == 1 or not self.cycles_alarming:
            return ""
        return f", but {self.cycles_alarming} of {self.cycles} cycles alarm singly"

    def _by_q(self) -> bool:
        return self.q / self.q_threshold >= self.t2 / self.t2_threshold

    def _value(self, one: Contribution) -> float:
        return one.q if self._by_q() else one.t2

    def _total(self) -> float:
        return sum(map(self._value, self.contributions)) or 1.0

    def _shares(self, by: str) -> dict[str, float]:
        shares: dict[str, float] = {}
        for one in self.contributions:
            name = getattr(one, by)
            shares[name] = shares.get(name, 0.0) + self._value(one) / self._total()
        return shares

    def _most(self) -> tuple[str, str, float]:
        """Return the channel and the kind of stroke that contribute most together, and their share."""
        shares: dict[tuple[str, str], float] = {}
        for one in self.contributions:
            pair = (one.channel, one.stroke)
            shares[pair] = shares.get(pair, 0.0) + self._value(one) / self._total()
        pair = max(shares, key=lambda one: shares[one])
        return *pair, shares[pair]


def _short(channel: str) -> str:
    return "current" if channel == "current_A" else SCHEMA[channel].meaning
