"""The verbs `detect learn` and `detect judge`: they read recordings, call the detector, and print."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import App, Parameter

from emaphm.cli.options import (
    FIGURES,
    RECORDING_KINDS,
    ActuatorFile,
    AsJson,
    Force,
    check_output,
    described_actuator,
    recording_of,
)
from emaphm.cli.output import draw, progress, say, show
from emaphm.errors import MethodError, RecordingError

if TYPE_CHECKING:
    from emaphm.actuator import Actuator
    from emaphm.detection import Detector, DetectorResult
    from emaphm.recording import Recording

app = App(name="detect", help="Detect cycles that are not like healthy ones, whatever the cause.")

DetectorFile = Annotated[Path, Parameter(help="Detector written by 'emaphm detect learn': .json.")]


@Parameter(name="*")
@dataclass(frozen=True)
class Detection:
    """How a detector learns from healthy recordings, and its rate of false alarms."""

    group: Annotated[
        Literal["file", "folder"] | None,
        Parameter(
            help="Where the cycles of one run are: in one file, or in all files of one folder. Default: "
            "folder if there are several folders and one of them has several files, otherwise file."
        ),
    ] = None
    subtract_model: Annotated[
        bool,
        Parameter(
            name=("--subtract-model", "--model"),
            negative=("--no-subtract-model", "--no-model"),
            help="Subtract the output of the actuator's model from the channels; otherwise use the measured "
            "channels.",
        ),
    ] = True
    false_alarm_rate: Annotated[
        float, Parameter(help="Accepted share of healthy cycles that are called not like healthy.")
    ] = 0.01
    seeded: Annotated[
        tuple[str, ...],
        Parameter(
            negative="",
            show_default=False,
            help="Recording with a known fault, as NAME=FILE, with which alarms are compared; may be "
            "repeated.",
        ),
    ] = ()

    def learned(
        self, files: Sequence[Path], recordings: "Sequence[Recording]", by: str, actuator: "Actuator"
    ) -> "Detector":
        """Return the detector learned from `recordings` in `files`; each file or folder (`by`) is one run."""
        from emaphm.detection import DETECTOR, Detector

        return Detector.learn(
            recordings,
            groups=[str(path.resolve().parent if by == "folder" else path.resolve()) for path in files],
            actuator=actuator if self.subtract_model else None,
            settings=replace(DETECTOR, false_alarm_rate=self.false_alarm_rate),
        )


@app.command
def learn(
    *recording: Annotated[Path, Parameter(help=f"Healthy recordings, each of one cycle: {RECORDING_KINDS}.")],
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="Detector to write: .json.")],
    detection: Detection = Detection(),
    actuator: ActuatorFile = "thesis",
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Learn a detector of deviations from healthy recordings, and write it to a file."""
    check_output(out, (".json",), force=force)
    described = described_actuator(actuator)
    recordings = [recording_of(path, described) for path in recording]
    examples = _examples(detection.seeded, described)
    from emaphm.detection.cycle import shared_channels

    by, notes = (detection.group, []) if detection.group else _grouping(recording)
    try:
        with progress("learning", as_json):
            learned = detection.learned(recording, recordings, by, described)
            detector = learned.with_seeded(examples)
    except RecordingError as error:
        raise RecordingError("; ".join([str(error), *notes])) from None
    detector.save(out)
    for note in () if as_json else notes:
        say(f"note: {note}")
    repeated = [name for name in shared_channels(recordings) if name not in detector.channels]
    text = str(detector)
    if repeated:
        text += f"\nIgnored, because equal in all recordings row by row: {', '.join(repeated)}."
    values = {
        "detector": str(out),
        "group": by,
        "notes": notes,
        **detector.to_dict(),
        "repeated_channels": repeated,
    }
    show(values, f"{text}\nWritten to {out}", as_json)


@app.command
def judge(
    detector: DetectorFile,
    *recording: Annotated[Path, Parameter(help=f"Recordings, each of one cycle: {RECORDING_KINDS}.")],
    together: Annotated[
        bool, Parameter(negative="", help="Judge the mean of all recordings, as cycles of one run.")
    ] = False,
    figure: Annotated[
        Path | None,
        Parameter(
            help="Write a figure of T² and Q relative to their thresholds, with the contributions of "
            "channels and segments: .png, .svg or .pdf."
        ),
    ] = None,
    actuator: Annotated[
        str | None,
        Parameter(
            help="TOML description by which the recordings are read, or the name of a built-in one; default "
            "that in the detector, otherwise 'thesis'. The subtracted model is always that of the detector."
        ),
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Decide whether recordings are like the healthy ones, and locate deviations by channel and segment."""
    check_output(figure, FIGURES, force=force)
    from emaphm.detection import Detector

    learned = Detector.load(detector)
    described = learned.actuator if actuator is None else described_actuator(actuator)
    described = described or described_actuator("thesis")
    recordings = [recording_of(path, described) for path in recording]
    if not recordings:
        raise MethodError("no recording to judge; name one or more files")
    results = [learned.judge(recordings)] if together else [learned.judge(cycle) for cycle in recordings]
    worst = max(results, key=lambda result: result.excess)
    alarms = sum(not result.like_healthy for result in results)
    values = {
        "not_like_healthy": alarms,
        "of": len(results),
        "results": [result.to_dict() for result in results],
    }
    show(values, _text(results, worst), as_json)
    draw(worst, figure)


def healthy_check(path: Path, recording: "Recording") -> "DetectorResult":
    """Return the result of the detector in a file for a recording."""
    from emaphm.detection import Detector

    return Detector.load(path).judge(recording)


def _grouping(files: Sequence[Path]) -> tuple[Literal["file", "folder"], list[str]]:
    """Return whether a file or a folder contains the cycles of one run, from the files' paths, and notes.

    If cycles of one run were counted as separate runs, the rate of false alarms would be several times the
    stated rate. Runs counted as cycles only widen the thresholds, or are refused because they are too few.
    """
    folders = Counter(path.resolve().parent for path in files)
    if len(folders) == 1 or max(folders.values(), default=1) == 1:
        return "file", []
    note = (
        f"{len(files)} files in {len(folders)} folders: all files of a folder count as cycles of one run "
        "(--group folder); if each file is a separate run, give --group file"
    )
    return "folder", [note]


def _text(results: "list[DetectorResult]", worst: "DetectorResult") -> str:
    if len(results) == 1:
        return str(worst)
    lines = [f"{result.recording}: {result.sentence}." for result in results]
    alarms = sum(not result.like_healthy for result in results)
    return "\n".join([*lines, f"{alarms} of {len(results)} are not like healthy. {worst.shown}."])


def _examples(seeded: tuple[str, ...], actuator: "Actuator") -> dict[str, list[Any]]:
    """Return the recordings of the --seeded options by fault."""
    examples: dict[str, list[Any]] = {}
    for assignment in seeded:
        name, separator, path = assignment.partition("=")
        if not (separator and name.strip() and path):
            raise MethodError(f"--seeded {assignment}: give NAME=FILE, e.g. lubrication=dry.csv")
        examples.setdefault(name.strip(), []).append(recording_of(Path(path), actuator))
    return examples
