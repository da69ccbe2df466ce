"""A detector of what is not like healthy, whatever causes it: learned from healthy recordings alone."""

import dataclasses
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.detection.content import DetectorContent
from emaphm.detection.cycle import Cycle, check_each_once, common_channels, cycle_of
from emaphm.detection.detector_file import read_detector, write_detector
from emaphm.detection.features import feature_names
from emaphm.detection.level import Level, judging
from emaphm.detection.manoeuvre import (
    HealthyAtLoad,
    HealthyManoeuvre,
    at_load,
    command_difference,
    learn_manoeuvre,
    same_load,
)
from emaphm.detection.other_unit import check_units
from emaphm.detection.result import Contribution, DetectorResult
from emaphm.detection.seeded import Seeded, nearest_seeded
from emaphm.detection.settings import DETECTOR, DetectorSettings
from emaphm.detection.thresholds import highest_rate, runs_to_show
from emaphm.errors import MethodError, RecordingError
from emaphm.recording import Recording


@dataclass(frozen=True, eq=False)
class Detector(DetectorContent):
    """Knows what healthy cycles look like, and says of others how far from that they are."""

    @classmethod
    def learn(
        cls,
        recordings: Sequence[Recording],
        *,
        groups: Sequence[Hashable] | None = None,
        actuator: Actuator | None = None,
        settings: DetectorSettings = DETECTOR,
    ) -> "Detector":
        """Learn from healthy recordings, of one cycle each.

        Which of them are the same manoeuvre at the same load is seen from `command_rad` and `load_Nm`
        (no load where that is absent).

        Parameters
        ----------
        recordings
            Of a healthy unit, five independent runs of each manoeuvre at least.
        groups
            The run that each recording is a cycle of: those of one run resemble each other, and are left
            out together. Each its own where left out.
        actuator
            What its model explains of command and load is taken off first; the description of the unit.
        settings
            See `DetectorSettings`.

        Raises
        ------
        RecordingError
            Too few runs, no channel in common, a recording is given twice, or cannot be meant for the
            actuator.
        MethodError
            `groups` has another length, a rate is impossible, or scikit-learn is not installed.
        """
        if not recordings:
            raise RecordingError(
                "no healthy recordings to learn from; give five runs of a manoeuvre at least"
            )
        labels = list(range(len(recordings))) if groups is None else list(groups)
        if len(labels) != len(recordings):
            raise MethodError(
                f"{len(labels)} groups for {len(recordings)} recordings; give the run of each recording"
            )
        channels = common_channels(recordings)
        cycles = [cycle_of(one, channels, actuator) for one in recordings]
        return cls.of_cycles(cycles, labels, channels, actuator, settings)

    @classmethod
    def of_cycles(
        cls,
        cycles: Sequence[Cycle],
        groups: Sequence[Hashable],
        channels: tuple[str, ...],
        actuator: Actuator | None = None,
        settings: DetectorSettings = DETECTOR,
    ) -> "Detector":
        """Learn from cycles that were prepared before; arguments and errors as in `learn`."""
        if not 0 < settings.false_alarm_rate < 1:
            raise MethodError(
                f"a rate of false alarms of {settings.false_alarm_rate:g} is impossible; give one between "
                "0 and 1, e.g. 0.01"
            )
        check_each_once(cycles)
        largest = max(float(np.abs(one.load).max()) for one in cycles)
        manoeuvres = []
        rest = list(range(len(cycles)))
        while rest:
            first = cycles[rest[0]]
            alike = [
                k
                for k in rest
                if not command_difference(first.command, first.interval_s, cycles[k], settings)
            ]
            rest = [k for k in rest if k not in alike]
            manoeuvres.append(
                learn_manoeuvre([cycles[k] for k in alike], [groups[k] for k in alike], largest, settings)
            )
        return cls(channels, tuple(manoeuvres), actuator, (), settings)

    def with_seeded(self, examples: Mapping[str, Sequence[Recording]]) -> "Detector":
        """Return the detector that also knows in which direction seeded faults lie.

        Parameters
        ----------
        examples
            Recordings with a fault, of one cycle each, by the fault's name; of a learned manoeuvre and load.
        """
        seeded = list(self.seeded)
        for fault, recordings in examples.items():
            found: dict[tuple[int, int], list[Array]] = {}
            for recording in recordings:
                cycle = cycle_of(recording, self.channels, self.actuator)
                place = self._place(cycle)
                manoeuvre = self.manoeuvres[place[0]]
                at = manoeuvre.loads[place[1]]
                found.setdefault(place, []).append(manoeuvre.deviations([cycle], at, self.settings)[0])
            seeded += [Seeded(fault, *place, np.mean(ones, axis=0)) for place, ones in found.items()]
        return dataclasses.replace(self, seeded=tuple(seeded))

    def judge(self, recordings: Recording | Sequence[Recording]) -> DetectorResult:
        """Say whether a cycle, or the cycles of a run taken together, are like healthy.

        Parameters
        ----------
        recordings
            One cycle; or several of the same manoeuvre and load, whose mean features are judged: by the
            scatter of means of healthy runs, and by that of single cycles, which few runs show better. What
            differs between cycles of one run averages out in their mean.

        Raises
        ------
        RecordingError
            The manoeuvre or the load was never seen healthy, cycles differ in them, one is given twice, or a
            channel is missing or in another unit.
        """
        given = [recordings] if isinstance(recordings, Recording) else list(recordings)
        return self.judge_cycles([cycle_of(one, self.channels, self.actuator) for one in given])

    def judge_cycles(self, cycles: Sequence[Cycle]) -> DetectorResult:
        """Judge cycles that were prepared before, together; errors as in `judge`."""
        if not cycles:
            raise RecordingError("no recording to judge; give one cycle at least")
        check_each_once(cycles)
        places = [self._place(one) for one in cycles]
        for cycle, place in zip(cycles, places, strict=True):
            if place != places[0]:
                raise RecordingError(
                    f"{cycle.source}: another manoeuvre or load than {cycles[0].source}; judge cycles of one "
                    "manoeuvre at one load together"
                )
        manoeuvre = self.manoeuvres[places[0][0]]
        at = manoeuvre.loads[places[0][1]]
        if self.actuator is None:
            tolerance = self.settings.rows_tolerance
            measured = [one.along(manoeuvre.command, tolerance).signals for one in cycles]
            check_units(cycles[0].source, measured, at.mean, self.channels)
        each = manoeuvre.deviations(cycles, at, self.settings)
        deviation = each.mean(axis=0, keepdims=True)
        level, by = judging(manoeuvre.levels, deviation, len(cycles))
        return DetectorResult(
            recording=cycles[0].source,
            cycles=len(cycles),
            cycles_alarming=int(np.sum(manoeuvre.levels[0].excess(each) > 1)),
            level_cycles=by.cycles,
            manoeuvre=f"{manoeuvre.name}, {at.name}",
            t2=float(by.scatter.t2(deviation)[0]),
            q=float(by.scatter.q(deviation)[0]),
            t2_threshold=by.t2_threshold,
            q_threshold=by.q_threshold,
            contributions=self._contributions(manoeuvre, by, deviation),
            nearest=nearest_seeded(self.seeded, by, places[0], deviation, self.settings),
            false_alarm_rate=self.settings.false_alarm_rate,
            shown=self.shown(level) + (f"; {drift_note([at])}" if places[0][1] in manoeuvre.drifting else ""),
            load_recorded=all(one.load_recorded for one in cycles),
        )

    def shown_rate(self, level: Level) -> float | None:
        """Return the highest rate of false alarms that the healthy runs of `level` leave room for.

        None where the runs are not independent: each resembles the one before it.
        """
        if level.independent < level.runs:
            return None
        return highest_rate(level.alarms, level.runs, self.settings.confidence)

    def shown(self, level: Level) -> str:
        """Return which rate of false alarms the healthy runs of `level` can show, in words."""
        s = self.settings
        bound = self.shown_rate(level)
        if bound is None:
            return (
                f"{level.alarms} of {level.runs} healthy runs left out alarmed, but each resembles the one "
                f"before it: they are worth {level.independent:.2g} independent ones, which show no rate of "
                "false alarms; if several files are cycles of one run, say so (--group folder, groups=)"
            )
        needed = runs_to_show(s.false_alarm_rate, s.confidence)
        text = (
            f"{level.alarms} of {level.runs} healthy runs left out alarmed: at most {100 * bound:.2g} % of "
            f"false alarms are shown, with {100 * s.confidence:g} % confidence"
        )
        if bound <= s.false_alarm_rate:
            return text
        return f"{text}; at most {100 * s.false_alarm_rate:g} % cannot be shown with fewer than {needed} runs"

    def save(self, path: str | Path) -> None:
        """Write the detector to one JSON file; `OutputError` where it cannot be written."""
        write_detector(self, path)

    @classmethod
    def load(cls, path: str | Path) -> "Detector":
        """Read a detector that `save` wrote; `MethodError` where it is none."""
        return read_detector(Path(path), cls)

    def to_dict(self) -> dict[str, Any]:
        """Return what `emaphm detect learn --json` prints."""
        return {
            "channels": list(self.channels),
            "model": self.actuator is not None,
            "false_alarm_rate": self.settings.false_alarm_rate,
            "manoeuvres": [
                {
                    "manoeuvre": one.name,
                    "loads": [at.name for at in one.loads],
                    "drifting": [one.loads[place].name for place in one.drifting],
                    "levels": [
                        {
                            "cycles": level.cycles,
                            "t2_threshold": level.t2_threshold,
                            "q_threshold": level.q_threshold,
                            "alarms": level.alarms,
                            "runs": level.runs,
                            "independent": level.independent,
                            "shown_rate": self.shown_rate(level),
                        }
                        for level in one.levels
                    ],
                }
                for one in self.manoeuvres
            ],
            "seeded": list(dict.fromkeys(one.fault for one in self.seeded)),
        }

    def __str__(self) -> str:
        """Return what it was taught, a line a manoeuvre."""
        lines = [f"Looks at {', '.join(self.channels)}{', less the model' if self.actuator else ''}."]
        for one in self.manoeuvres:
            lines.append(f"{one.name}: {', '.join(load.name for load in one.loads)}.")
            lines += [f"  {level.name}: {self.shown(level)}." for level in one.levels]
            if one.drifting:
                lines.append(f"  Note: {drift_note([one.loads[place] for place in one.drifting])}.")
        if self.seeded:
            lines.append(f"Seeded faults: {', '.join(dict.fromkeys(one.fault for one in self.seeded))}.")
        return "\n".join(lines)

    def _place(self, cycle: Cycle) -> tuple[int, int]:
        """Return which manoeuvre and which of its loads `cycle` is."""
        largest = max(float(np.abs(at.load).max()) for one in self.manoeuvres for at in one.loads)
        differences = [one.difference(cycle, self.settings) for one in self.manoeuvres]
        known = [k for k, difference in enumerate(differences) if not difference]
        if not known:
            nearest = min(zip(differences, self.manoeuvres, strict=True), key=lambda pair: len(pair[0]))
            raise RecordingError(
                f"{cycle.source}: this manoeuvre was never seen healthy ({nearest[0]}; known: "
                f"{'; '.join(one.name for one in self.manoeuvres)}); teach it healthy recordings of this one"
            )
        for k in known:
            load = cycle.along(self.manoeuvres[k].command, self.settings.rows_tolerance).load
            for place, at in enumerate(self.manoeuvres[k].loads):
                if same_load(load, at.load, largest, self.settings):
                    return k, place
        raise RecordingError(
            f"{cycle.source}: never seen healthy {at_load(cycle)} (known: "
            f"{', '.join(at.name for k in known for at in self.manoeuvres[k].loads)}); teach the detector "
            "healthy recordings like it"
        )

    def _contributions(
        self, manoeuvre: HealthyManoeuvre, level: Level, deviation: Array
    ) -> tuple[Contribution, ...]:
        t2 = level.scatter.t2_contributions(deviation)[0]
        q = level.scatter.q_contributions(deviation)[0]
        names = feature_names(self.channels, manoeuvre.segments, self.settings)
        segments = [(one.label(manoeuvre.interval_s), one.stroke) for one in manoeuvre.segments]
        return tuple(
            Contribution(name.channel, *segments[name.segment], name.kind, float(t2[k]), float(q[k]))
            for k, name in enumerate(names)
        )


def drift_note(loads: Sequence[HealthyAtLoad]) -> str:
    """Return what it means that healthy runs drift at `loads`."""
    return (
        f"healthy runs at {' and '.join(at.name for at in loads)} drift in their order: later ones may alarm "
        "more often than that; teach runs from more days"
    )
