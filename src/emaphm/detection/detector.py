"""The detector of deviations from healthy, of any cause, learned from healthy recordings alone."""

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
from emaphm.detection.level import Level, level_and_judge
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
    """A detector: healthy cycles of manoeuvres, and the comparison of other cycles with these."""

    @classmethod
    def learn(
        cls,
        recordings: Sequence[Recording],
        *,
        groups: Sequence[Hashable] | None = None,
        actuator: Actuator | None = None,
        settings: DetectorSettings = DETECTOR,
    ) -> "Detector":
        """Return a detector learned from healthy recordings, of one cycle each.

        Recordings with the same `command_rad` and `load_Nm` are of the same manoeuvre at the same load; a
        missing load counts as 0.

        Parameters
        ----------
        recordings
            Recordings of a healthy unit, at least five independent runs of each manoeuvre.
        groups
            The run of each recording. Cycles of one run are correlated, and are left out together. Default:
            each recording is a run of its own.
        actuator
            The description of the unit; the output of its model for command and load is subtracted first.
        settings
            See `DetectorSettings`.

        Raises
        ------
        RecordingError
            There are too few runs, there is no channel in common, a recording is given twice, or a recording
            cannot be of this actuator.
        MethodError
            `groups` has another length, a rate is impossible, or scikit-learn is not installed.
        """
        if not recordings:
            raise RecordingError(
                "no healthy recordings to learn from; give five runs of a manoeuvre at least"
            )
        labels = list(range(len(recordings))) if groups is None else list(groups)
        check_groups(labels, recordings)
        channels = common_channels(recordings)
        cycles = [cycle_of(recording, channels, actuator) for recording in recordings]
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
        """Return a detector learned from cycles (`cycle_of`); other arguments and errors as in `learn`."""
        if not 0 < settings.false_alarm_rate < 1:
            raise MethodError(
                f"a rate of false alarms of {settings.false_alarm_rate:g} is impossible; give one between "
                "0 and 1, e.g. 0.01"
            )
        check_each_once(cycles)
        largest = max(float(np.abs(cycle.load).max()) for cycle in cycles)
        manoeuvres = []
        remaining = list(range(len(cycles)))
        while remaining:
            first = cycles[remaining[0]]
            same = [
                k
                for k in remaining
                if not command_difference(first.command, first.interval_s, cycles[k], settings)
            ]
            remaining = [k for k in remaining if k not in same]
            manoeuvres.append(
                learn_manoeuvre([cycles[k] for k in same], [groups[k] for k in same], largest, settings)
            )
        return cls(channels, tuple(manoeuvres), actuator, (), settings)

    def with_seeded(self, examples: Mapping[str, Sequence[Recording]]) -> "Detector":
        """Return the detector with the mean deviations of seeded faults in addition.

        Parameters
        ----------
        examples
            Recordings with a fault, by the fault's name: of one cycle each, of a learned manoeuvre and load.
        """
        seeded = list(self.seeded)
        for fault, recordings in examples.items():
            by_place: dict[tuple[int, int], list[Array]] = {}
            for recording in recordings:
                cycle = cycle_of(recording, self.channels, self.actuator)
                place = self._place(cycle)
                manoeuvre = self.manoeuvres[place[0]]
                at = manoeuvre.loads[place[1]]
                by_place.setdefault(place, []).append(manoeuvre.deviations([cycle], at, self.settings)[0])
            seeded += [
                Seeded(fault, *place, np.mean(deviations, axis=0)) for place, deviations in by_place.items()
            ]
        return dataclasses.replace(self, seeded=tuple(seeded))

    def judge(self, recordings: Recording | Sequence[Recording]) -> DetectorResult:
        """Return how far a cycle, or the mean of the cycles of a run, is from healthy.

        Parameters
        ----------
        recordings
            One cycle, or several of the same manoeuvre and load. The mean features of several are judged by
            the scatter of the means of healthy runs, and by that of single healthy cycles, which is known
            better if there are few runs. Differences between the cycles of a run average out in their mean.

        Raises
        ------
        RecordingError
            There are no healthy cycles of the manoeuvre or the load, cycles differ in them, one is given
            twice, or a channel is missing or in another unit.
        """
        given = [recordings] if isinstance(recordings, Recording) else list(recordings)
        return self.judge_cycles([cycle_of(recording, self.channels, self.actuator) for recording in given])

    def judge_cycles(self, cycles: Sequence[Cycle]) -> DetectorResult:
        """Return how far the mean of cycles (`cycle_of`) is from healthy; errors as in `judge`."""
        if not cycles:
            raise RecordingError("no recording to judge; give one cycle at least")
        check_each_once(cycles)
        places = [self._place(cycle) for cycle in cycles]
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
            measured = [cycle.aligned_to(manoeuvre.command, tolerance).signals for cycle in cycles]
            check_units(cycles[0].source, measured, at.mean, self.channels)
        deviations = manoeuvre.deviations(cycles, at, self.settings)
        mean = deviations.mean(axis=0, keepdims=True)
        own, judge = level_and_judge(manoeuvre.levels, mean, len(cycles))
        return DetectorResult(
            recording=cycles[0].source,
            cycles=len(cycles),
            cycles_alarming=int(np.sum(manoeuvre.levels[0].excess(deviations) > 1)),
            level_cycles=judge.cycles,
            manoeuvre=f"{manoeuvre.name}, {at.name}",
            t2=float(judge.scatter.t2(mean)[0]),
            q=float(judge.scatter.q(mean)[0]),
            t2_threshold=judge.t2_threshold,
            q_threshold=judge.q_threshold,
            contributions=self._contributions(manoeuvre, judge, mean),
            nearest=nearest_seeded(self.seeded, judge, places[0], mean, self.settings),
            false_alarm_rate=self.settings.false_alarm_rate,
            shown=self.shown(own) + (f"; {drift_note([at])}" if places[0][1] in manoeuvre.drifting else ""),
            load_recorded=all(cycle.load_recorded for cycle in cycles),
        )

    def shown_rate(self, level: Level) -> float | None:
        """Return the confidence bound on the rate of false alarms; None if the runs are correlated."""
        if level.independent < level.runs:
            return None
        return highest_rate(level.alarms, level.runs, self.settings.confidence)

    def shown(self, level: Level) -> str:
        """Return the sentence on the rate of false alarms that the healthy runs of `level` show."""
        s = self.settings
        bound = self.shown_rate(level)
        if bound is None:
            return (
                f"{level.alarms} of {level.runs} healthy runs left out alarmed, but each resembles the run "
                f"before it: they count as {level.independent:.2g} independent runs, which show no rate of "
                "false alarms; if several files are cycles of one run, group them (--group folder, groups=)"
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
        """Write the detector to one JSON file; `OutputError` if it cannot be written."""
        write_detector(self, path)

    @classmethod
    def load(cls, path: str | Path) -> "Detector":
        """Return the detector in a file that `save` wrote; `MethodError` if it is none."""
        return read_detector(Path(path), cls)

    def to_dict(self) -> dict[str, Any]:
        """Return the values that `emaphm detect learn --json` prints."""
        return {
            "channels": list(self.channels),
            "model": self.actuator is not None,
            "false_alarm_rate": self.settings.false_alarm_rate,
            "manoeuvres": [
                {
                    "manoeuvre": manoeuvre.name,
                    "loads": [at.name for at in manoeuvre.loads],
                    "drifting": [manoeuvre.loads[place].name for place in manoeuvre.drifting],
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
                        for level in manoeuvre.levels
                    ],
                }
                for manoeuvre in self.manoeuvres
            ],
            "seeded": list(dict.fromkeys(seeded.fault for seeded in self.seeded)),
        }

    def __str__(self) -> str:
        """Return the learned channels, manoeuvres and faults, a manoeuvre in a line."""
        lines = [f"Channels: {', '.join(self.channels)}{', less the model' if self.actuator else ''}."]
        for manoeuvre in self.manoeuvres:
            lines.append(f"{manoeuvre.name}: {', '.join(at.name for at in manoeuvre.loads)}.")
            lines += [f"  {level.name}: {self.shown(level)}." for level in manoeuvre.levels]
            if manoeuvre.drifting:
                drifting = [manoeuvre.loads[place] for place in manoeuvre.drifting]
                lines.append(f"  Note: {drift_note(drifting)}.")
        if self.seeded:
            faults = dict.fromkeys(seeded.fault for seeded in self.seeded)
            lines.append(f"Seeded faults: {', '.join(faults)}.")
        return "\n".join(lines)

    def _place(self, cycle: Cycle) -> tuple[int, int]:
        """Return the indices of the manoeuvre of `cycle`, and of the load among its loads."""
        largest = max(float(np.abs(at.load).max()) for manoeuvre in self.manoeuvres for at in manoeuvre.loads)
        differences = [manoeuvre.difference(cycle, self.settings) for manoeuvre in self.manoeuvres]
        known = [k for k, difference in enumerate(differences) if not difference]
        if not known:
            nearest = min(zip(differences, self.manoeuvres, strict=True), key=lambda pair: len(pair[0]))
            raise RecordingError(
                f"{cycle.source}: the detector has no healthy cycles of this manoeuvre ({nearest[0]}; known: "
                f"{'; '.join(manoeuvre.name for manoeuvre in self.manoeuvres)}); learn again with healthy "
                "recordings of this manoeuvre"
            )
        for k in known:
            load = cycle.aligned_to(self.manoeuvres[k].command, self.settings.rows_tolerance).load
            for place, at in enumerate(self.manoeuvres[k].loads):
                if same_load(load, at.load, largest, self.settings):
                    return k, place
        raise RecordingError(
            f"{cycle.source}: the detector has no healthy cycles {at_load(cycle)} (known: "
            f"{', '.join(at.name for k in known for at in self.manoeuvres[k].loads)}); learn again with "
            "healthy recordings at this load"
        )

    def _contributions(
        self, manoeuvre: HealthyManoeuvre, level: Level, deviation: Array
    ) -> tuple[Contribution, ...]:
        t2 = level.scatter.t2_contributions(deviation)[0]
        q = level.scatter.q_contributions(deviation)[0]
        names = feature_names(self.channels, manoeuvre.segments, self.settings)
        segments = [(segment.label(manoeuvre.interval_s), segment.stroke) for segment in manoeuvre.segments]
        return tuple(
            Contribution(name.channel, *segments[name.segment], name.kind, float(t2[k]), float(q[k]))
            for k, name in enumerate(names)
        )


def check_groups(groups: Sequence[Hashable], recordings: Sequence[Recording]) -> None:
    """Raise `MethodError` if there is not one group, the run, for each recording."""
    if len(groups) != len(recordings):
        raise MethodError(f"{len(groups)} groups for {len(recordings)} recordings; give the run of each")


def drift_note(loads: Sequence[HealthyAtLoad]) -> str:
    """Return the note on the consequence of drifting healthy runs at `loads`."""
    return (
        f"healthy runs at {' and '.join(at.name for at in loads)} drift in their order: later runs may alarm "
        "more often than that; learn with runs from more days"
    )
