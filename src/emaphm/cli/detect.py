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

app = App(name="detect", help="Say whether cycles are like healthy ones, whatever the cause.")

DetectorFile = Annotated[Path, Parameter(help="Detector that 'detect learn' wrote: .json.")]


@Parameter(name="*")
@dataclass(frozen=True)
class Detection:
    """How a detector learns from healthy recordings, and how often it may be wrong of them."""

    group: Annotated[
        Literal["file", "folder"] | None,
        Parameter(
            help="What holds the cycles of one run: each file, or all files of a folder. Where left out: "
            "folders, if there are several and one has several files; else files."
        ),
    ] = None
    subtract_model: Annotated[
        bool,
        Parameter(
            name=("--subtract-model", "--model"),
            negative=("--no-subtract-model", "--no-model"),
            help="Take off what the actuator's model explains; else channels as measured.",
        ),
    ] = True
    false_alarm_rate: Annotated[
        float, Parameter(help="Share of healthy cycles that may be called not like healthy.")
    ] = 0.01
    seeded: Annotated[
        tuple[str, ...],
        Parameter(
            negative="",
            show_default=False,
            help="NAME=FILE, a recording with a known fault, to compare others with; may be repeated.",
        ),
    ] = ()

    def learned(
        self, files: Sequence[Path], recordings: "Sequence[Recording]", by: str, actuator: "Actuator"
    ) -> "Detector":
        """Return the detector of `recordings` in `files`, with each file or folder `by` as one run."""
        from emaphm.detection import DETECTOR, Detector

        return Detector.learn(
            recordings,
            groups=[str(path.resolve().parent if by == "folder" else path.resolve()) for path in files],
            actuator=actuator if self.subtract_model else None,
            settings=replace(DETECTOR, false_alarm_rate=self.false_alarm_rate),
        )


@app.command
def learn(
    *recording: Annotated[Path, Parameter(help=f"Healthy recordings of one cycle each: {RECORDING_KINDS}.")],
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="Detector to write: .json.")],
    detection: Detection = Detection(),
    actuator: ActuatorFile = "thesis",
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Learn from healthy recordings what healthy looks like, and write it to one file."""
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
    for note in notes:
        say(f"note: {note}")
    repeated = [name for name in shared_channels(recordings) if name not in detector.channels]
    text = str(detector)
    if repeated:
        text += f"\nNot looked at, as the same in all recordings row by row: {', '.join(repeated)}."
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
    *recording: Annotated[Path, Parameter(help=f"Recordings of one cycle each: {RECORDING_KINDS}.")],
    together: Annotated[
        bool, Parameter(negative="", help="Judge the mean of all, as the cycles of one run.")
    ] = False,
    figure: Annotated[
        Path | None,
        Parameter(help="Draw T² and Q against the thresholds, and where they come from: .png, .svg, .pdf."),
    ] = None,
    actuator: ActuatorFile = "thesis",
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Say of recordings whether they are like the healthy ones, and if not, where."""
    check_output(figure, FIGURES, force=force)
    from emaphm.detection import Detector

    known = Detector.load(detector)
    described = known.actuator or described_actuator(actuator)
    recordings = [recording_of(path, described) for path in recording]
    if not recordings:
        raise MethodError("no recording to judge; name one or more files")
    results = [known.judge(recordings)] if together else [known.judge(one) for one in recordings]
    worst = max(results, key=lambda one: one.excess)
    alarms = sum(not one.like_healthy for one in results)
    values = {"not_like_healthy": alarms, "of": len(results), "results": [one.to_dict() for one in results]}
    show(values, _text(results, worst), as_json)
    draw(worst, figure)


def healthy_check(path: Path, recording: "Recording") -> "DetectorResult":
    """Return what the detector in a file says of a recording."""
    from emaphm.detection import Detector

    return Detector.load(path).judge(recording)


def _grouping(files: Sequence[Path]) -> tuple[Literal["file", "folder"], list[str]]:
    """Return what holds the cycles of a run, as far as the places of the files say, and a note on it.

    Cycles of a run taken for runs of their own have several times the stated rate of false alarms; runs taken
    for cycles only make for wider thresholds, or are refused as too few.
    """
    folders = Counter(path.resolve().parent for path in files)
    if len(folders) == 1 or max(folders.values(), default=1) == 1:
        return "file", []
    note = (
        f"{len(files)} files in {len(folders)} folders: all files of a folder count as cycles of one run "
        "(--group folder); if each file is a run of its own, give --group file"
    )
    return "folder", [note]


def _text(results: "list[DetectorResult]", worst: "DetectorResult") -> str:
    if len(results) == 1:
        return str(worst)
    lines = [f"{one.recording}: {one.sentence}." for one in results]
    alarms = sum(not one.like_healthy for one in results)
    return "\n".join([*lines, f"{alarms} of {len(results)} are not like healthy. {worst.shown}."])


def _examples(seeded: tuple[str, ...], actuator: "Actuator") -> dict[str, list[Any]]:
    """Return the recordings that the --seeded options name, by fault."""
    examples: dict[str, list[Any]] = {}
    for assignment in seeded:
        name, separator, path = assignment.partition("=")
        if not (separator and name.strip() and path):
            raise MethodError(f"--seeded {assignment}: give NAME=FILE, e.g. lubrication=dry.csv")
        examples.setdefault(name.strip(), []).append(recording_of(Path(path), actuator))
    return examples
