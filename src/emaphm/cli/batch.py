"""The verb `diagnose` for several recordings: one diagnosis each, or a joint diagnosis of one unit."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from emaphm.cli.interruption import resumable
from emaphm.cli.options import Common, Execution, known_values
from emaphm.cli.output import counter, progress, show, show_line
from emaphm.errors import MethodError, RecordingError

if TYPE_CHECKING:
    from emaphm.actuator import Actuator
    from emaphm.fleet import DiagnosisSettings
    from emaphm.fleet.sources import FileReading


@Parameter(name="*")
@dataclass(frozen=True)
class BatchOptions:
    """How several recordings are diagnosed, and where finished results are stored."""

    joint: Annotated[
        bool,
        Parameter(
            negative="", help="Estimate the faults of one unit jointly, from all the recordings given."
        ),
    ] = False
    execution: Execution = Execution()  # noqa: RUF009 - frozen
    out: Annotated[
        Path | None,
        Parameter(
            name=("--out", "-o"),
            help="Folder where each result of several recordings is stored when it is finished; after an "
            "interruption, the same command resumes.",
        ),
    ] = None

    @property
    def is_given(self) -> bool:
        """Whether any of these options was given; a single recording is then treated as a batch."""
        return self.joint or self.execution.is_given or self.out is not None


def reading(by: str | None, known: tuple[str, ...]) -> "FileReading":
    """Return the settings for reading files, from the options --by and --known."""
    from emaphm.fleet.sources import FileReading

    return FileReading(by, known_values(known))


def diagnose_several(
    paths: Sequence[Path],
    actuator: "Actuator",
    chosen: "DiagnosisSettings",
    reading: "FileReading",
    several: BatchOptions,
    common: Common,
) -> None:
    """Print a table with one row per recording, or one line of JSON each; or one joint diagnosis.

    Raises
    ------
    MethodError
        An option does not apply to a joint diagnosis.
    RecordingError
        Some recordings could not be diagnosed; raised after the other recordings are done.
    """
    if several.joint:
        _check_joint(chosen, several)
        _diagnose_joint(paths, actuator, chosen, reading, several.execution.workers, common)
    else:
        _diagnose_each(paths, actuator, chosen, reading, several, common.as_json)


def _diagnose_each(
    paths: Sequence[Path],
    actuator: "Actuator",
    chosen: "DiagnosisSettings",
    reading: "FileReading",
    several: BatchOptions,
    as_json: bool,
) -> None:
    from emaphm.fleet import batch_table, diagnose_all, recording_files

    files, rows, failures, done = recording_files(paths), [], [], 0
    out, execution = several.out, several.execution
    hint = f"finished results are stored in {out}; the same command resumes" if out else "nothing is stored"
    # On one terminal, lines of results and the progress bar would interleave.
    with resumable(hint), counter("diagnosing", as_json and sys.stdout.isatty()) as count:
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
                return  # later lines could not be printed either, and no folder would store them
            if result.error:
                failures.append(result.error)
            else:
                done += 1
    if not as_json:
        show({}, batch_table(rows), as_json=False)
    if failures:
        raise RecordingError(_failure_message(failures, done))


def _failure_message(failures: Sequence[str], done: int) -> str:
    """Return a sentence on the recordings that could not be diagnosed, with the first reason."""
    if len(failures) == 1 and not done:
        return f"nothing could be diagnosed: {failures[0]}"
    if not done:
        return f"none of {len(failures)} recordings could be diagnosed; the first failure: {failures[0]}"
    share = f"{len(failures)} of {len(failures) + done} recordings"
    return f"{share} could not be diagnosed, the others are done; the first failure: {failures[0]}"


def _check_joint(chosen: "DiagnosisSettings", several: BatchOptions) -> None:
    """Refuse options that do not apply to a joint diagnosis."""
    from emaphm.fleet import DiagnosisSettings

    defaults, execution = DiagnosisSettings(), several.execution
    given = {"--scheduler": execution.scheduler, "--out": several.out}
    named = [name for name, value in given.items() if value is not None]
    named += [
        f"--{name}"
        for name in ("method", "model", "fitness", "posterior", "estimator")
        if getattr(chosen, name) != getattr(defaults, name)
    ]
    if named:
        raise MethodError(
            f"{named[0]} is for recordings diagnosed one by one; leave out {named[0]} or --joint"
        )


def _diagnose_joint(
    paths: Sequence[Path],
    actuator: "Actuator",
    chosen: "DiagnosisSettings",
    reading: "FileReading",
    workers: int | None,
    common: Common,
) -> None:
    """Print the joint diagnosis of the unit from which all recordings come."""
    from emaphm.diagnosis.joint import diagnose_joint as identify
    from emaphm.fleet.sources import recording_files, recordings_in

    recordings = [
        recording for path in recording_files(paths) for recording in recordings_in(path, actuator, reading)
    ]
    with progress("diagnosing", common.as_json) as advance:
        diagnosis = identify(
            recordings,
            actuator,
            nuisances=chosen.nuisances,
            max_corrections=chosen.max_corrections,
            seed=chosen.seed,
            workers=workers,
            on_progress=advance,
        )
    common.show(diagnosis.to_dict(), str(diagnosis))
