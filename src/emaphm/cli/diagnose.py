"""The verb `diagnose`: of one recording itself; of several as `emaphm.cli.batch` does."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from emaphm.cli import batch
from emaphm.cli.batch import Several
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
from emaphm.errors import MethodError

if TYPE_CHECKING:
    from emaphm.actuator import Actuator
    from emaphm.fleet import DiagnosisSettings
    from emaphm.recording import Recording


@Parameter(name="*")
@dataclass(frozen=True)
class Method:
    """How a recording is diagnosed."""

    method: Annotated[
        str,
        Parameter(
            help="hybrid; genetic, particle-swarm, differential-evolution, grey-wolf, dragonfly (or ga, pso, "
            "de, gwo, da), dragonfly-thesis, random; cma-es, l-shade, scipy-de, pymoo-NAME. Any but hybrid "
            "may end in +lsq: it finds the starts, least squares do the rest."
        ),
    ] = "hybrid"
    model: Annotated[str, Parameter(help="Model to fit: averaged, monitor or reference.")] = "averaged"
    fitness: Annotated[
        str, Parameter(help="What an optimiser minimises: least_squares, thesis or total_least_squares.")
    ] = "least_squares"
    correction: Annotated[
        bool, Parameter(help="Correct the model's bias by a few runs of the reference model (hybrid, +lsq).")
    ] = True
    nuisance: Annotated[
        str | None,
        Parameter(
            help="What is estimated with the faults, with commas between: load, hinge, load_variation, "
            "temperature, supply, inertia, delay, current_offset, current_scale, current_drift, "
            "current_delay, and the same of voltage, position and speed; or 'none'. As the TOML says if "
            "left out, and what deviates significantly."
        ),
    ] = None
    posterior: Annotated[
        bool,
        Parameter(
            negative="",
            help="Sample the posterior too, for estimates at a bound: 5 to 20 times as long as the search, "
            "minutes where a recording has thousands of rows.",
        ),
    ] = False
    estimator: Annotated[
        Path | None,
        Parameter(
            help="Begin where an estimator of 'emaphm train' says, in place of a search of all the range."
        ),
    ] = None
    fast: Fast = False

    def settings(self, seed: int) -> "DiagnosisSettings":
        """Return what the options say, as the library takes it."""
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
        Parameter(help="Also say whether the recording is like healthy ones: a file of 'detect learn'."),
    ] = None,
    by: By = None,
    known: KnownList = (),
    report: Annotated[Path | None, Parameter(help="Write a report of one recording: .html.")] = None,
    several: Several = Several(),  # noqa: B008 - frozen
    common: Common = Common(),  # noqa: B008 - frozen
) -> None:
    """Say which faults explain a recording, and how sure that is; of several, each in a row of a table.

    With --json, several recordings are one line of JSON each, in the order given.
    """
    common.check((report, (".html",)))
    described = described_actuator(actuator)
    check_fast(method.fast, method.estimator)
    several.execution.check()
    if not (further or several.is_given or by or recording.is_dir()):
        recorded = recording_of(recording, described, known)
        _diagnose_one(recorded, described, method, healthy, report, common)
        return
    if report:
        raise MethodError("--report is of one recording; diagnose that one alone, without --joint")
    if healthy:
        raise MethodError("--healthy is for one recording; judge several by 'emaphm detect judge'")
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
    # Not before: what cannot be read is refused without waiting for a compiler to be loaded.
    settings = method.settings(common.seed)
    with progress("diagnosing", common.as_json) as advance:
        diagnosis = settings.diagnosed(recording, actuator, workers=None, on_progress=advance)
    diagnosis = replace(diagnosis, healthy_check=check)
    # First: a full disk must not take the answer too.
    common.show(diagnosis.to_dict(), str(diagnosis))
    if report:
        from emaphm.report import write_report

        write_report(diagnosis, report, force=common.force)
        if not common.as_json:
            common.show({}, f"Report written to {report}")
