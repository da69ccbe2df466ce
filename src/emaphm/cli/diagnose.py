"""The verb `diagnose`, for one recording; several recordings are passed to `emaphm.cli.batch`."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from emaphm.cli import batch
from emaphm.cli.batch import BatchOptions
from emaphm.cli.detect import healthy_check
from emaphm.cli.options import (
    ActuatorFile,
    By,
    Common,
    Fast,
    KnownList,
    RecordingsAt,
    check_fast,
    described_actuator,
    names_in,
    recording_of,
)
from emaphm.cli.output import progress
from emaphm.errors import MethodError, RecordingError
from emaphm.input_files import is_folder

if TYPE_CHECKING:
    from emaphm.actuator import Actuator
    from emaphm.fleet import DiagnosisSettings
    from emaphm.recording import Recording


_ALONE = "give one file, without --by, --joint, --workers, --scheduler and --out"
"""Remedy where an option of one recording is given for several: these options treat a file as several."""


@Parameter(name="*")
@dataclass(frozen=True)
class Method:
    """How a recording is diagnosed."""

    method: Annotated[
        str,
        Parameter(
            help="Method of identification: hybrid; genetic, particle-swarm, differential-evolution, "
            "grey-wolf, dragonfly (or ga, pso, de, gwo, da), dragonfly-thesis, random; cma-es, l-shade, "
            "scipy-de, pymoo-NAME. Every method except hybrid may be followed by +lsq: its result is then "
            "the start of a least-squares fit."
        ),
    ] = "hybrid"
    model: Annotated[str, Parameter(help="Model to fit: averaged, monitor or reference.")] = "averaged"
    fitness: Annotated[
        str,
        Parameter(
            help="Objective that an optimiser minimises: least_squares, thesis or total_least_squares."
        ),
    ] = "least_squares"
    correction: Annotated[
        bool,
        Parameter(
            help="Correct the bias of the fitted model with a few runs of the reference model (hybrid, +lsq)."
        ),
    ] = True
    nuisance: Annotated[
        str | None,
        Parameter(
            help="Nuisance parameters to estimate with the faults, separated by commas: load, hinge, "
            "load_variation, temperature, supply, inertia, delay, current_offset, current_scale, "
            "current_drift, current_delay, and likewise for voltage, position and speed; or 'none'. Default: "
            "the TOML's [nuisances], and those that deviate significantly."
        ),
    ] = None
    posterior: Annotated[
        bool,
        Parameter(
            negative="",
            help="Also sample the posterior, for estimates at a bound: takes 5 to 20 times as long as the "
            "search, minutes for a recording with thousands of rows.",
        ),
    ] = False
    estimator: Annotated[
        Path | None,
        Parameter(
            help="Estimator written by 'emaphm train', whose answer is the start in place of a search of the "
            "full range."
        ),
    ] = None
    fast: Fast = False

    def settings(self, seed: int) -> "DiagnosisSettings":
        """Return the options as settings of the library, with `seed`."""
        from emaphm.estimation.bias_correction import MAX_CORRECTIONS
        from emaphm.fleet import DiagnosisSettings

        return DiagnosisSettings(
            method=self.method,
            model=self.model,
            fitness=self.fitness,
            max_corrections=MAX_CORRECTIONS if self.correction else 0,
            nuisances=None if self.nuisance is None else tuple(names_in(self.nuisance)),
            posterior=self.posterior,
            estimator=None if self.estimator is None else str(self.estimator),
            fast=self.fast,
            seed=seed,
        )


def diagnose(
    recording: RecordingsAt,
    *further: RecordingsAt,
    actuator: ActuatorFile = "thesis",
    method: Method = Method(),
    healthy: Annotated[
        Path | None,
        Parameter(
            help="Detector written by 'emaphm detect learn', .json: also decide whether the recording is "
            "like healthy ones."
        ),
    ] = None,
    by: By = None,
    known: KnownList = (),
    report: Annotated[Path | None, Parameter(help="Write a report of one recording: .html.")] = None,
    several: BatchOptions = BatchOptions(),  # noqa: B008 - frozen
    common: Common = Common(),  # noqa: B008 - frozen
) -> None:
    """Identify the faults that explain a recording, with their uncertainty.

    Several recordings give a table with one row each, or with --json one line of JSON each, in the given
    order.
    """
    common.check((report, (".html",)))
    described = described_actuator(actuator)
    check_fast(method.fast, method.estimator)
    several.execution.check()
    if not (further or several.is_given or by or is_folder(recording, RecordingError)):
        recorded = recording_of(recording, described, known)
        _diagnose_one(recorded, described, method, healthy, report, common)
        return
    if report is not None:
        raise MethodError(f"--report is of one recording; {_ALONE}")
    if healthy is not None:
        raise MethodError(
            f"--healthy is for one recording; {_ALONE}, or use 'emaphm detect judge' for several"
        )
    settings, reading = method.settings(common.seed), batch.reading(by, known)
    batch.diagnose_several((recording, *further), described, settings, reading, several, common)


def _diagnose_one(
    recording: "Recording",
    actuator: "Actuator",
    method: Method,
    healthy: Path | None,
    report: Path | None,
    common: Common,
) -> None:
    check = None if healthy is None else healthy_check(healthy, recording)
    # Not earlier: unreadable files are refused without waiting for the compiler to be loaded.
    settings = method.settings(common.seed)
    with progress("diagnosing", common.as_json) as advance:
        diagnosis = settings.diagnosed(recording, actuator, workers=None, on_progress=advance)
    diagnosis = replace(diagnosis, healthy_check=check)
    # Before the report: a full disk must not lose the answer too.
    common.show(diagnosis.to_dict(), str(diagnosis))
    if report:
        from emaphm.report import write_report

        write_report(diagnosis, report, force=common.force)
        if not common.as_json:
            common.show({}, f"Report written to {report}")
