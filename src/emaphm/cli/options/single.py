"""Single options that several verbs share, each with its name and its help."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cyclopts import Token


def whole_number(_: Any, tokens: "Sequence[Token]") -> int:
    """Return a whole number; 1.5 is refused, whereas the default conversion would round it."""
    try:
        return int(tokens[0].value)
    except ValueError:
        raise ValueError(f'unable to convert "{tokens[0].value}" into int; give a whole number.') from None


AsJson = Annotated[
    bool, Parameter(name="--json", negative="", help="Print one JSON object and nothing else.")
]
Seed = Annotated[
    int,
    Parameter(
        converter=whole_number, help="Seed of the random numbers; the same seed gives the same results."
    ),
]
Force = Annotated[bool, Parameter(negative="", help="Replace existing output files.")]
ActuatorFile = Annotated[
    str,
    Parameter(
        help="TOML description of the actuator, or the name of a built-in one: 'thesis' (or 'bldc'), "
        "'six-step', 'pmsm', 'dc'."
    ),
]
FaultList = Annotated[
    tuple[str, ...],
    Parameter(
        name="--fault",
        negative="",
        show_default=False,
        help="Normalised fault as NAME=VALUE, e.g. backlash=0.2: from 0 to 1, friction also below 0; may be "
        "repeated; healthy by default.",
    ),
]
RECORDING_KINDS = ".csv, .parquet, .mat, .tdms, .h5, .hdf5 or .mf4"
RecordingFile = Annotated[Path, Parameter(help=f"Recording: {RECORDING_KINDS}.")]
RecordingsAt = Annotated[
    Path, Parameter(help=f"Recording: {RECORDING_KINDS}; or a folder with several recordings.")
]
Workers = Annotated[
    int | None, Parameter(converter=whole_number, help="Number of parallel processes; default one per core.")
]
Scheduler = Annotated[
    str | None,
    Parameter(
        help="Address of a Dask scheduler whose workers run the tasks, e.g. tcp://10.0.0.1:8786; by default "
        "they run on this machine."
    ),
]
By = Annotated[
    str | None,
    Parameter(
        help="How a file is split into recordings: at each change of the columns named, separated by commas; "
        "by 'period' or 'rests' of the command; or into 'stretches' without a gap. Default: the TOML's "
        "[reading]."
    ),
]
KnownList = Annotated[
    tuple[str, ...],
    Parameter(
        name="--known",
        negative="",
        show_default=False,
        help="Constant of the whole file as NAME=VALUE: a channel in its SI unit, e.g. temperature_K=300, or "
        "a label, e.g. serial=A17; may be repeated.",
    ),
]
Fast = Annotated[
    bool,
    Parameter(
        negative="",
        help="Return the answer of --estimator without refining it: this takes milliseconds, but is less "
        "accurate.",
    ),
]
FigureFile = Annotated[
    Path | None, Parameter(help="Write a figure of the measured and modelled channels: .png, .svg or .pdf.")
]

FIGURES = (".png", ".svg", ".pdf")
