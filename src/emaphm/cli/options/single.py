"""Single options that several verbs take, each with its name and its help."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cyclopts import Token


def whole_number(_: Any, tokens: "Sequence[Token]") -> int:
    """Return a whole number; 1.5 is refused, where the usual conversion would round it."""
    try:
        return int(tokens[0].value)
    except ValueError:
        raise ValueError(f'unable to convert "{tokens[0].value}" into int; give a whole number.') from None


AsJson = Annotated[
    bool, Parameter(name="--json", negative="", help="Print one JSON object and nothing else.")
]
Seed = Annotated[
    int,
    Parameter(converter=whole_number, help="Source of all randomness; the same seed gives the same numbers."),
]
Force = Annotated[bool, Parameter(negative="", help="Replace existing output files.")]
ActuatorFile = Annotated[
    str,
    Parameter(
        help="TOML description of the actuator, or a built-in one: 'thesis' (or 'bldc'), 'six-step', 'pmsm', "
        "'dc'."
    ),
]
FaultList = Annotated[
    tuple[str, ...],
    Parameter(
        name="--fault",
        negative="",
        show_default=False,
        help="NAME=VALUE, from 0 to 1; friction may be less; may be repeated.",
    ),
]
RECORDING_KINDS = ".csv, .parquet, .mat, .tdms, .h5, .hdf5 or .mf4"
RecordingFile = Annotated[Path, Parameter(help=f"Recording: {RECORDING_KINDS}.")]
RecordingsAt = Annotated[Path, Parameter(help=f"Recordings: {RECORDING_KINDS}; or a folder of them.")]
Workers = Annotated[
    int | None, Parameter(converter=whole_number, help="Processes side by side; one a core if left out.")
]
Scheduler = Annotated[
    str | None, Parameter(help="Address of a Dask scheduler to run on, e.g. tcp://10.0.0.1:8786.")
]
By = Annotated[
    str | None,
    Parameter(
        help="What a file is cut by: columns with commas between, 'period' of the command, its 'rests', or "
        "'stretches' without a gap. As the TOML says if left out."
    ),
]
KnownList = Annotated[
    tuple[str, ...],
    Parameter(
        name="--known",
        negative="",
        show_default=False,
        help="NAME=VALUE that holds for the whole file: a channel in its SI unit, such as temperature_K=300, "
        "or a label, such as serial=A17; may be repeated.",
    ),
]
Fast = Annotated[
    bool, Parameter(negative="", help="Take the estimator's answer as it is: milliseconds, less exact.")
]
FigureFile = Annotated[Path | None, Parameter(help="Draw measured against model: .png, .svg or .pdf.")]

FIGURES = (".png", ".svg", ".pdf")
