"""The verb `calibrate`: reads recordings or campaigns, calls the library, and prints."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from emaphm.cli.options import (
    FIGURES,
    RECORDING_KINDS,
    ActuatorFile,
    Common,
    FigureFile,
    described_actuator,
    names_in,
    recording_of,
)
from emaphm.cli.output import draw, progress
from emaphm.errors import MethodError, RecordingError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from emaphm.actuator import Actuator


@Parameter(name="*")
@dataclass(frozen=True)
class ModelOptions:
    """Laws and loop of the model of the unit."""

    laws: Annotated[
        str | None,
        Parameter(
            help="Laws to add, separated by commas, e.g. stribeck,gravity; or 'auto' for the laws that "
            "reduce the error in recordings left out of the fit. Default: none."
        ),
    ] = None
    loop: Annotated[
        Literal["auto", "closed", "measured"],
        Parameter(
            help="How the motion is obtained. closed: simulated from the command, with the controller; "
            "measured: taken from the recording, and the torque that it requires is compared, without a "
            "controller; auto: closed, unless a recording contradicts the controller's gains."
        ),
    ] = "auto"

    @property
    def chosen_laws(self) -> str | list[str] | None:
        """The laws to add, or "auto"; None if the option is left out."""
        names = None if self.laws is None else names_in(self.laws)
        return names[0] if names == ["auto"] else names


@Parameter(name="*")
@dataclass(frozen=True)
class FitOptions:
    """Bias correction, and nuisances that are estimated with the parameters."""

    correction: Annotated[
        bool, Parameter(help="Correct the bias of the fitted model with a few runs of the reference model.")
    ] = True
    nuisance: Annotated[
        str | None,
        Parameter(
            help="Nuisance parameters to estimate for each recording, separated by commas: load, hinge, "
            "load_variation, temperature, supply, inertia, delay, current_offset, current_scale, "
            "current_drift, current_delay, and likewise for voltage, position and speed; or 'none'. Default: "
            "the TOML's [nuisances], except those that cannot be separated from a free parameter."
        ),
    ] = None

    @property
    def nuisances(self) -> list[str] | None:
        """The nuisances of each recording; None if the option is left out."""
        return None if self.nuisance is None else names_in(self.nuisance)

    @property
    def max_corrections(self) -> int:
        """Largest number of bias-correction iterations."""
        from emaphm.estimation.bias_correction import MAX_CORRECTIONS

        return MAX_CORRECTIONS if self.correction else 0


def calibrate(
    *recording: Annotated[
        Path,
        Parameter(help=f"Recordings: {RECORDING_KINDS}; or a campaign: .toml, or .csv with a column 'file'."),
    ],
    free: Annotated[
        str | None,
        Parameter(
            help="Parameters to estimate, separated by commas, e.g. inertia,viscous,coulomb. Default: those "
            "in [tolerances] and [baseline]; with --laws, the usual ones that the recordings identify."
        ),
    ] = None,
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="Calibrated description to write: .toml.")],
    modelling: ModelOptions = ModelOptions(),
    actuator: ActuatorFile = "thesis",
    fitting: FitOptions = FitOptions(),
    figure: FigureFile = None,
    common: Common = Common(),  # noqa: B008 - frozen
) -> None:
    """Estimate parameters of a healthy unit from its recordings, and write them with their covariance.

    All recordings are fitted jointly. The [baseline] of the calibrated description is the prior of later
    diagnoses.
    """
    common.check((out, (".toml",)), (figure, FIGURES))
    described = described_actuator(actuator)
    if free is None and modelling.laws is None and not described.uncertain_parameters:
        raise MethodError(
            "nothing to calibrate: --free and --laws are left out, and the description has no [tolerances]; "
            "name parameters with --free, e.g. --free inertia,coulomb, or laws with --laws, e.g. --laws auto"
        )
    recorded = _recordings(recording, described)
    names, laws = None if free is None else names_in(free), modelling.chosen_laws
    from emaphm.calibration import calibrate as estimate

    with progress("calibrating", common.as_json) as advance:
        result = estimate(
            recorded,
            described,
            names,
            laws=laws,
            loop=modelling.loop,
            nuisances=fitting.nuisances,
            max_corrections=fitting.max_corrections,
            seed=common.seed,
            on_progress=advance,
        )
    files = ", ".join(path.name for path in recording)
    estimated = ", ".join(result.parameters)
    comments = f"Calibrated on {files}: {estimated}; all other values as in '{described.name}'.\n{result}"
    result.actuator.to_toml(out, comments=comments)
    text = f"{result}\n\nCalibrated description written to {out}"
    common.show(result.to_dict(), text)
    draw(result, figure)


def _recordings(paths: "Sequence[Path]", actuator: "Actuator") -> "list[Any]":
    """Return the recordings in files and campaigns; those of campaigns have their known values.

    A file that is given twice is refused: its noise would count as that of two independent recordings.
    """
    from emaphm.calibration import is_campaign, read_campaign

    recorded: list[Any] = []
    given: dict[Path, Path] = {}

    def read_once(path: Path, actuator: "Actuator") -> Any:
        first = given.setdefault(path.resolve(), path)
        if first is not path:
            spelled = "" if first == path else f", as {first}"
            raise RecordingError(
                f"{path}: this file is given twice{spelled}, and would count as two recordings; give it once"
            )
        return recording_of(path, actuator)

    for path in paths:
        if is_campaign(path):
            recorded += read_campaign(path, actuator, read_once)
        else:
            recorded.append(read_once(path, actuator))
    return recorded
