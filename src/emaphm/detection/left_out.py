"""Cross-validation of a detector: each healthy run is judged by a detector learned from the other runs."""

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass

from emaphm.actuator import Actuator
from emaphm.detection.cycle import check_each_once, common_channels, cycle_of
from emaphm.detection.detector import Detector, check_groups
from emaphm.detection.result import DetectorResult
from emaphm.detection.settings import DETECTOR, DetectorSettings
from emaphm.errors import RecordingError
from emaphm.recording import Recording


@dataclass(frozen=True)
class LeftOut:
    """Results of the detector learned from the other runs, for the cycles of run `group` and their mean."""

    group: Hashable
    cycles: tuple[DetectorResult, ...]
    run: DetectorResult


def judged_left_out(
    recordings: Sequence[Recording],
    groups: Sequence[Hashable],
    actuator: Actuator | None = None,
    settings: DetectorSettings = DETECTOR,
) -> Iterator[LeftOut]:
    """Yield the results of each healthy run, of one load, by a detector learned from the other runs.

    Parameters
    ----------
    recordings, actuator, settings
        As in `Detector.learn`.
    groups
        The run of each recording.

    Raises
    ------
    RecordingError
        There are too few runs without the one left out, there is no channel in common, or a recording cannot
        be of this actuator.
    MethodError
        `groups` has another length, a rate is impossible, or scikit-learn is not installed.
    """
    check_groups(groups, recordings)
    channels = common_channels(recordings)
    cycles = [cycle_of(recording, channels, actuator) for recording in recordings]
    check_each_once(cycles)
    for group in dict.fromkeys(groups):
        inside = [k for k, label in enumerate(groups) if label == group]
        others = [k for k, label in enumerate(groups) if label != group]
        if not others:
            raise RecordingError(f"all {len(cycles)} recordings are of one run; give further runs")
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
