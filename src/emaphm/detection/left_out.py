"""Healthy runs judged by detectors that never saw them: what a detector's figures on healthy data must be."""

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass

from emaphm.actuator import Actuator
from emaphm.detection.cycle import check_each_once, common_channels, cycle_of
from emaphm.detection.detector import Detector
from emaphm.detection.result import DetectorResult
from emaphm.detection.settings import DETECTOR, DetectorSettings
from emaphm.errors import RecordingError
from emaphm.recording import Recording


@dataclass(frozen=True)
class LeftOut:
    """A healthy run as the detector learned from all other runs judges it: its cycles, and all together."""

    group: Hashable
    cycles: tuple[DetectorResult, ...]
    run: DetectorResult


def judged_left_out(
    recordings: Sequence[Recording],
    groups: Sequence[Hashable],
    actuator: Actuator | None = None,
    settings: DetectorSettings = DETECTOR,
) -> Iterator[LeftOut]:
    """Yield each healthy run as judged without it in means, scatter and thresholds; a run has one load.

    Parameters
    ----------
    recordings, actuator, settings
        As in `Detector.learn`.
    groups
        The run that each recording is a cycle of, one a recording.

    Raises
    ------
    RecordingError
        Too few runs without the one left out, no channel in common, or a recording cannot be meant for the
        actuator.
    MethodError
        A rate is impossible, or scikit-learn is not installed.
    """
    channels = common_channels(recordings)
    cycles = [cycle_of(one, channels, actuator) for one in recordings]
    check_each_once(cycles)
    for group in dict.fromkeys(groups):
        inside = [k for k, one in enumerate(groups) if one == group]
        others = [k for k, one in enumerate(groups) if one != group]
        try:
            detector = Detector.of_cycles(
                [cycles[k] for k in others], [groups[k] for k in others], channels, actuator, settings
            )
        except RecordingError as error:
            run = cycles[inside[0]].source
            raise RecordingError(f"{error} (counted without the run of {run}, which is left out)") from None
        yield LeftOut(
            group,
            tuple(detector.judge_cycles([cycles[k]]) for k in inside),
            detector.judge_cycles([cycles[k] for k in inside]),
        )
