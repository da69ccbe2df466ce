"""What several verbs take: the options, and how their text becomes objects."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from emaphm.cli.output import say
from emaphm.errors import ExecutionError, FaultError, MethodError, RecordingError, SignalError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from cyclopts import Token

    from emaphm.actuator import Actuator, Command, Faults, Load, Sampled
    from emaphm.actuator.parameters import Mechanics


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
        name="--fault", negative="", help="NAME=VALUE, from 0 to 1; friction may be less; may be repeated."
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
        help="NAME=VALUE that holds for the whole file: a channel in its SI unit, such as temperature_K=300, "
        "or a label, such as serial=A17; may be repeated.",
    ),
]
FigureFile = Annotated[Path | None, Parameter(help="Draw measured against model: .png, .svg or .pdf.")]

CommandName = Annotated[
    str,
    Parameter(
        help="chirp, decaying-chirp, step (after a tenth of the duration), ramp, sine, or a file with time_s "
        "and command_rad."
    ),
]
Amplitude = Annotated[
    float | None, Parameter(help="Of a command by name, at the user [rad]; 0.005 if left out.")
]
About = Annotated[
    float | None,
    Parameter(
        help="Where the shaft rests first, at the user [rad]; a command by name is counted from there. 0 if "
        "left out, or for a command by name the middle of the travel, where an end stop is nearer than its "
        "amplitude."
    ),
]
Frequency = Annotated[
    float | None, Parameter(help="Of the sine, or the last of a chirp [Hz]; 4 and 15 if left out.")
]
Duration = Annotated[float, Parameter(help="Of the recording [s].")]
SampleRate = Annotated[float, Parameter(help="Rows a second [Hz].")]

FIGURES = (".png", ".svg", ".pdf")

AMPLITUDE = 5e-3
"""Of a command by name [rad]."""

REST_BEFORE_STEP = 0.1
"""Share of the duration after which a step by name begins: without a rest its rows would be all the same."""

FREQUENCIES = {"chirp": 15.0, "decaying-chirp": 15.0, "sine": 4.0}
"""Of the commands that have one: of the sine, and the last of a chirp [Hz]."""

CLOSE = 0.85
"""Likeness of a name to a channel's from which on it is taken for a slip."""


def check_seed(seed: int) -> None:
    """Refuse a seed that no generator takes."""
    if seed < 0:
        raise SignalError(f"--seed {seed} is negative; give 0 or more")


def check_workers(workers: int | None, scheduler: str | None) -> None:
    """Refuse numbers of workers that cannot be, and workers together with a scheduler's."""
    if workers is not None and workers < 1:
        raise ExecutionError(f"--workers {workers}: give 1 or more")
    if workers is not None and scheduler is not None:
        raise ExecutionError(
            "--workers and --scheduler exclude each other: the scheduler has workers of its own"
        )


def check_fast(fast: bool, estimator: Path | None) -> None:
    """Refuse --fast without the estimator whose answer it takes."""
    if fast and estimator is None:
        raise MethodError("--fast takes an estimator's answer; name its file: --estimator FILE")


def check_output(path: Path | None, endings: tuple[str, ...], *, force: bool) -> None:
    """Refuse an output that could not be written, before the work that it would be lost with."""
    from emaphm.output_files import check_writable

    if path is not None:
        check_writable(path, force=force, endings=endings)


def described_actuator(name: str) -> "Actuator":
    """Return the actuator that --actuator names."""
    from emaphm.actuator import Actuator

    return Actuator.load(name)


def recording_of(path: Path, actuator: "Actuator", known: tuple[str, ...] = ()) -> Any:
    """Return the recording in a file, its channels as `actuator` and the --known options say."""
    from emaphm.recording import read_recording

    return read_recording(path, actuator, known=known_values(known))


def known_values(assignments: tuple[str, ...]) -> dict[str, float | str]:
    """Return what the --known options say: numbers of channels, texts of labels."""
    from emaphm.recording.schema import SCHEMA

    values: dict[str, float | str] = {}
    for assignment in assignments:
        name, equals, value = (part.strip() for part in assignment.partition("="))
        if not (name and equals and value):
            raise RecordingError(f"--known {assignment}: give NAME=VALUE, e.g. temperature_K=300")
        if name in values:
            raise RecordingError(f"--known {name} is given twice; give it once")
        if name not in SCHEMA:
            _check_label(name, value)
            values[name] = value
            continue
        try:
            values[name] = float(value)
        except ValueError:
            raise RecordingError(f"--known {assignment}: {name} is a number in {SCHEMA[name].unit}") from None
    return values


def _check_label(name: str, value: str) -> None:
    """Refuse a number under a name that is nearly a channel's: as a label it would count for nothing."""
    from difflib import get_close_matches

    from emaphm.recording.schema import SCHEMA

    try:
        float(value)
    except ValueError:
        return
    channels = {one.lower().rpartition("_")[0]: one for one in ("load_Nm", "temperature_K", "supply_V")}
    channels |= {one.lower(): one for one in SCHEMA}
    for close in get_close_matches(name.lower(), channels, n=1, cutoff=CLOSE):
        raise RecordingError(
            f"--known {name}={value}: no channel has that name (did you mean '{channels[close]}'?); for a "
            "label give another name"
        )


def fault_vector(assignments: tuple[str, ...]) -> "Faults":
    """Return the faults that the --fault options set."""
    from emaphm.actuator import Faults

    values = {}
    for assignment in assignments:
        name, _, value = assignment.partition("=")
        if name.strip() in values:
            raise FaultError(f"--fault {name.strip()} is given twice; give each fault once")
        try:
            values[name.strip()] = float(value)
        except ValueError:
            raise FaultError(f"--fault {assignment}: give NAME=VALUE, e.g. friction=0.25") from None
    return Faults.from_mapping(values)


def command_named(
    name: str,
    amplitude: float | None,
    frequency: float | None,
    about: float | None,
    duration: float,
    sample_rate: float,
    mechanics: "Mechanics",
) -> "Command":
    """Return the command that --command and its companions describe, with room between the end stops."""
    from emaphm import actuator

    if not duration > 0:
        raise SignalError(f"--duration {duration:g}: give more than 0 s")
    if not all(math.isfinite(value or 0.0) for value in (amplitude, frequency, about)):
        raise SignalError(
            f"the command is not finite with --amplitude {amplitude}, --frequency {frequency}, --about "
            f"{about}; give numbers"
        )
    if frequency is not None and name not in FREQUENCIES:
        raise SignalError(f"--frequency is of {', '.join(FREQUENCIES)}; leave it out with '{name}'")
    by_name = amplitude is not None
    if frequency is None:
        frequency = FREQUENCIES.get(name, 0.0)
    if abs(frequency) > sample_rate / 2 > 0:
        raise SignalError(
            f"--frequency {frequency:g} Hz is above half of the {sample_rate:g} rows a second, which would "
            "show another motion; give a lower one, or a higher --sample-rate"
        )
    amplitude = AMPLITUDE if amplitude is None else amplitude
    centre = mechanics.centre_for(abs(amplitude)) if about is None else about
    makers: dict[str, Callable[[], Command]] = {
        "chirp": lambda: actuator.Chirp(amplitude, stop_hz=frequency, duration=duration, about=centre),
        "decaying-chirp": lambda: actuator.DecayingChirp(
            amplitude, stop_hz=frequency, duration=duration, about=centre
        ),
        "step": lambda: actuator.Step(amplitude, REST_BEFORE_STEP * duration, centre),
        "ramp": lambda: actuator.Ramp(amplitude / duration, about=centre),
        "sine": lambda: actuator.Sine(amplitude, frequency, centre),
    }
    if name in makers:
        return makers[name]()
    if not Path(name).suffix:
        raise SignalError(
            f"unknown command '{name}' (known: {', '.join(makers)}); or give a file such as command.csv"
        )
    if by_name:
        raise SignalError(f"--amplitude is of {', '.join(makers)}; leave it out with a file")
    signal = _signal(name, "command_rad", duration)
    _say_of_jump(signal, name, 0.0 if about is None else about)
    return signal


def _say_of_jump(command: "Sampled", path: str, start: float) -> None:
    """Say where a command from a file begins elsewhere than the shaft, by more than it covers itself."""
    first = float(command.values[0])
    if abs(first - start) > float(command.values.max() - command.values.min()):
        say(
            f"{path}: the command begins at {first:g}, the shaft at {start:g}: it jumps there. With --about "
            f"{first:g} it would rest there"
        )


def load_named(value: str, duration: float) -> "Load":
    """Return the load that --load gives: a number, or a file."""
    try:
        return float(value)
    except ValueError:
        if not Path(value).suffix:
            raise SignalError(f"--load {value} is neither a number nor a file; give e.g. 0.05") from None
        return _signal(value, "load_Nm", duration)


def _signal(path: str, name: str, duration: float) -> "Sampled":
    from emaphm.recording import read_signal

    signal = read_signal(path, name)
    first, last = signal.time_s[0], signal.time_s[-1]
    if first >= duration or last <= 0:
        raise SignalError(
            f"{path}: time_s runs from {first:g} to {last:g} s, the simulation from 0 to {duration:g} s; "
            "shift the times to start at 0"
        )
    return signal


def names_in(text: str) -> list[str]:
    """Return the names in `text`, which has commas between them; nothing for "none"."""
    names = [name.strip() for name in text.split(",") if name.strip()]
    if "none" in names and len(names) > 1:
        raise MethodError(f"'{text}': give 'none' alone, or the names")
    return [] if names == ["none"] else names
