"""The verb `calibrate`: it reads recordings or campaigns, calls the library, and prints."""

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
class Modelling:
    """What the unit is modelled by."""

    laws: Annotated[
        str | None,
        Parameter(
            help="Laws to add, with commas between, e.g. stribeck,gravity; or 'auto': those that lower "
            "the error in recordings left out of the fit."
        ),
    ] = None
    loop: Annotated[
        Literal["auto", "closed", "measured"],
        Parameter(
            help="closed: simulate the controller from the command; measured: compare the torque that the "
            "measured motion requires, no controller needed; auto: closed, unless a recording contradicts "
            "the controller's gains."
        ),
    ] = "auto"

    @property
    def chosen_laws(self) -> str | list[str] | None:
        """The laws to add, or "auto"; None where left out."""
        names = None if self.laws is None else names_in(self.laws)
        return names[0] if names == ["auto"] else names


@Parameter(name="*")
@dataclass(frozen=True)
class Fitting:
    """What else is estimated, and by which models."""

    correction: Annotated[
        bool, Parameter(help="Correct the model's bias by a few runs of the reference model.")
    ] = True
    nuisance: Annotated[
        str | None,
        Parameter(
            help="What is unknown of each recording, with commas between: load, hinge, load_variation, "
            "temperature, supply, inertia, delay, current_offset, current_scale, current_drift, "
            "current_delay, and the same of voltage, position and speed; or 'none'. As the TOML says if "
            "left out, less what a free parameter cannot be separated from."
        ),
    ] = None

    @property
    def nuisances(self) -> list[str] | None:
        """The nuisances of each recording; None where left out."""
        return None if self.nuisance is None else names_in(self.nuisance)

    @property
    def max_corrections(self) -> int:
        """Most corrections of the model's bias."""
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
            help="Parameters to estimate, with commas between, e.g. inertia,viscous,coulomb. With --laws it "
            "may be left out: the usual ones that the recordings identify."
        ),
    ] = None,
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="Calibrated TOML to write.")],
    modelling: Modelling = Modelling(),
    actuator: ActuatorFile = "thesis",
    fitting: Fitting = Fitting(),
    figure: FigureFile = None,
    common: Common = Common(),  # noqa: B008 - frozen
) -> None:
    """Estimate physical parameters of a healthy unit from its recordings; write them with their covariance.

    All are fitted at once. The calibrated description's [baseline] is the prior of later diagnoses.
    """
    common.check((out, (".toml",)), (figure, FIGURES))
    if free is None and modelling.laws is None:
        raise MethodError(
            "nothing to calibrate: --free and --laws are left out; name parameters by --free, e.g. "
            "--free inertia,coulomb, or laws by --laws, e.g. --laws auto"
        )
    described = described_actuator(actuator)
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
    found = ", ".join(result.parameters)
    comments = f"Calibrated on {files}: {found}; the rest as in '{described.name}'.\n{result}"
    result.actuator.to_toml(out, comments=comments)
    text = f"{result}\n\nCalibrated description written to {out}"
    common.show(result.to_dict(), text)
    draw(result, figure)


def _recordings(paths: "Sequence[Path]", actuator: "Actuator") -> "list[Any]":
    """Return the recordings in files and in campaigns, with what is known of them.

    A file that is given twice is refused: its noise would count as that of two independent recordings.
    """
    from emaphm.calibration import is_campaign, read_campaign

    recorded: list[Any] = []
    given: dict[Path, Path] = {}

    def read_once(path: Path, actuator: "Actuator") -> Any:
        before = given.setdefault(path.resolve(), path)
        if before is not path:
            spelled = "" if before == path else f", as {before}"
            raise RecordingError(
                f"{path}: this file is given twice{spelled}, and would count as two recordings; leave one "
                "of the two out"
            )
        return recording_of(path, actuator)

    for path in paths:
        is_one = not is_campaign(path)
        recorded += [read_once(path, actuator)] if is_one else read_campaign(path, actuator, read_once)
    return recorded
