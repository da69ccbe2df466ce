"""The verb `diagnose` on several recordings: each by itself, or all of one unit together."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from emaphm.cli.interruption import going_on
from emaphm.cli.options import Common, Execution, known_values
from emaphm.cli.output import counter, progress, show, show_line
from emaphm.errors import MethodError, RecordingError

if TYPE_CHECKING:
    from emaphm.actuator import Actuator
    from emaphm.fleet import DiagnosisSettings
    from emaphm.fleet.sources import FileReading


@Parameter(name="*")
@dataclass(frozen=True)
class Several:
    """How several recordings are diagnosed, and where what finished is kept."""

    joint: Annotated[
        bool,
        Parameter(negative="", help="One estimate of the faults of one unit, from all its recordings."),
    ] = False
    execution: Execution = Execution()  # noqa: RUF009 - frozen
    out: Annotated[
        Path | None,
        Parameter(
            name=("--out", "-o"),
            help="Folder that keeps the results of several recordings as they finish; the same command goes "
            "on where it stopped.",
        ),
    ] = None

    @property
    def is_given(self) -> bool:
        """Whether any of these options was given: a single recording is then a batch of one."""
        return self.joint or self.execution.is_given or self.out is not None


def reading(by: str | None, known: tuple[str, ...]) -> "FileReading":
    """Return how files are read, as the options --by and --known say."""
    from emaphm.fleet.sources import FileReading

    return FileReading(by, known_values(known))


def diagnose_several(
    paths: Sequence[Path],
    actuator: "Actuator",
    chosen: "DiagnosisSettings",
    reading: "FileReading",
    several: Several,
    common: Common,
) -> None:
    """Print a table with one row a recording, or one line of JSON each; or one diagnosis of all of them.

    Raises
    ------
    MethodError
        An option is none of a joint diagnosis.
    RecordingError
        In the end, where some could not be diagnosed; the others are done.
    """
    if several.joint:
        _check_joint(chosen, several)
        _diagnose_joint(paths, actuator, chosen, reading, common)
    else:
        _diagnose_each(paths, actuator, chosen, reading, several, common.as_json)


def _diagnose_each(
    paths: Sequence[Path],
    actuator: "Actuator",
    chosen: "DiagnosisSettings",
    reading: "FileReading",
    several: Several,
    as_json: bool,
) -> None:
    from emaphm.fleet import batch_table, diagnose_all, recording_files

    files, rows, broken, done = recording_files(paths), [], [], 0
    out, execution = several.out, several.execution
    how = f"what finished is kept in {out}; the same command goes on" if out else "nothing is kept"
    # Lines on the same terminal as the progress would tear each other.
    with going_on(how), counter("diagnosing", as_json and sys.stdout.isatty()) as count:
        for result in diagnose_all(
            files,
            actuator,
            chosen,
            reading=reading,
            workers=execution.workers,
            scheduler=execution.scheduler,
            folder=out,
            on_file=count,
        ):
            if not as_json:
                rows.append(result.row)
            elif not show_line(result.values) and out is None:
                return  # the others could not be read either, and no folder is to keep them
            if result.error:
                broken.append(result.error)
            else:
                done += 1
    if not as_json:
        show({}, batch_table(rows), as_json=False)
    if broken:
        raise RecordingError(_failures(broken, done))


def _failures(broken: Sequence[str], done: int) -> str:
    """Return what could not be diagnosed, as a sentence; the first reason stands for all."""
    if len(broken) == 1 and not done:
        return f"nothing could be diagnosed: {broken[0]}"
    if not done:
        return f"none of {len(broken)} recordings could be diagnosed; the first: {broken[0]}"
    which = f"{len(broken)} of {len(broken) + done} recordings"
    return f"{which} could not be diagnosed, the others are done; the first: {broken[0]}"


def _check_joint(chosen: "DiagnosisSettings", several: Several) -> None:
    """Refuse options that a joint diagnosis does not have."""
    from emaphm.fleet import DiagnosisSettings

    usual, execution = DiagnosisSettings(), several.execution
    given = {"--workers": execution.workers, "--scheduler": execution.scheduler, "--out": several.out}
    named = [name for name, value in given.items() if value is not None]
    named += [
        f"--{name}"
        for name in ("method", "model", "fitness", "posterior", "estimator")
        if getattr(chosen, name) != getattr(usual, name)
    ]
    if named:
        raise MethodError(f"{named[0]} is for recordings diagnosed one by one; leave it or --joint out")


def _diagnose_joint(
    paths: Sequence[Path],
    actuator: "Actuator",
    chosen: "DiagnosisSettings",
    reading: "FileReading",
    common: Common,
) -> None:
    """Print one diagnosis of the unit that all recordings are of."""
    from emaphm.diagnosis.joint import diagnose_joint as identify
    from emaphm.fleet.sources import recording_files, recordings_in

    recordings = [one for path in recording_files(paths) for one in recordings_in(path, actuator, reading)]
    with progress("diagnosing", common.as_json) as advance:
        diagnosis = identify(
            recordings,
            actuator,
            nuisances=chosen.nuisances,
            max_corrections=chosen.max_corrections,
            seed=chosen.seed,
            on_progress=advance,
        )
    common.show(diagnosis.to_dict(), str(diagnosis))
