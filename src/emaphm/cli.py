"""The command line: it parses, calls the library, and prints."""

import errno
import io
import json
import math
import os
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, CycloptsError, Parameter

from emaphm.errors import EmaphmError, FaultError, SignalError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from emaphm.actuator import Actuator, Command, Faults, Load


def _version() -> str:
    from emaphm.version import VERSION

    return VERSION


app = App(
    name="emaphm",
    help="Faults of an electromechanical actuator, identified from a recording.",
    version=_version,
    suppress_keyboard_interrupt=False,
)

AsJson = Annotated[
    bool, Parameter(name="--json", negative="", help="Print one JSON object and nothing else.")
]
Seed = Annotated[int, Parameter(help="Source of all randomness; the same seed gives the same numbers.")]
Force = Annotated[bool, Parameter(negative="", help="Replace existing output files.")]
ActuatorFile = Annotated[
    str, Parameter(help="TOML description of the actuator, or 'thesis' for the built-in one.")
]
FaultList = Annotated[
    tuple[str, ...],
    Parameter(name="--fault", negative="", help="NAME=VALUE, from 0 to 1; may be repeated."),
]
RecordingFile = Annotated[Path, Parameter(help="Recording: .csv, .parquet or .mat.")]
FigureFile = Annotated[Path | None, Parameter(help="Draw measured against model: .png, .svg or .pdf.")]

FIGURES = (".png", ".svg", ".pdf")


@app.command
def demo(
    *,
    out: Annotated[Path, Parameter(help="Folder for the report.")] = Path("demo"),
    seed: Seed = 0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Simulate a faulty actuator with sensor noise, diagnose it, and print found beside true."""
    from emaphm.demo import run_demo

    _check_seed(seed)
    with _progress("diagnosing", as_json) as advance:
        result = run_demo(out, seed=seed, force=force, on_progress=advance)
    _print(result.to_dict(), str(result), as_json)


@app.command
def simulate(
    out: Annotated[Path, Parameter(help="Recording to write: .csv or .parquet.")],
    *,
    model: Annotated[str, Parameter(help="reference, monitor or averaged.")] = "reference",
    command: Annotated[
        str,
        Parameter(help="chirp, decaying-chirp, step, ramp, sine, or a file with time_s and command_rad."),
    ] = "chirp",
    amplitude: Annotated[float, Parameter(help="Of the command, at the user [rad].")] = 5e-3,
    frequency: Annotated[
        float | None, Parameter(help="Of the sine, or the last of a chirp [Hz]; 4 and 15 if left out.")
    ] = None,
    fault: FaultList = (),
    noise: Annotated[float, Parameter(help="Sensor noise on the currents, rms [A].")] = 0.0,
    adc_bits: Annotated[int | None, Parameter(help="Resolution of the sensors' converters.")] = None,
    duration: Annotated[float, Parameter(help="Of the recording [s].")] = 0.5,
    sample_rate: Annotated[float, Parameter(help="Rows a second [Hz].")] = 5000.0,
    load: Annotated[
        str, Parameter(help="At the motor [N·m]: a number, or a file with time_s and load_Nm.")
    ] = "0",
    actuator: ActuatorFile = "thesis",
    seed: Seed = 0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Simulate an actuator and write its recording."""
    from emaphm import rig
    from emaphm.recording import check_writable, write_recording
    from emaphm.recording.writers import ENDINGS

    _check_seed(seed)
    check_writable(out, force=force, endings=ENDINGS)
    if not 0 <= noise < math.inf:
        raise SignalError(f"--noise {noise:g} is no rms; give 0 or more")
    described, faults = _actuator(actuator), _faults(fault)
    with _progress("simulating", as_json):
        recording = rig.simulate(
            described,
            _command(command, amplitude, frequency, duration),
            faults=faults,
            model=model,
            duration=duration,
            sample_rate=sample_rate,
            load=_load(load, duration),
            noise=noise,
            adc_bits=adc_bits,
            sampling=described.channels.sampling,
            seed=seed,
        )
    write_recording(recording, out, force=force)
    summary = {
        "recording": str(out),
        "samples": recording.samples,
        "duration_s": recording.duration_s,
        "sample_rate_hz": recording.sample_rate_hz,
        "channels": list(recording.names),
        "model": model,
        "k": faults.vector.tolist(),
        "actuator": described.name,
        "seed": seed,
        "version": _version(),
    }
    _print(summary, f"{recording!r}\nwritten to {out}", as_json)


@app.command
def diagnose(
    recording: RecordingFile,
    *,
    actuator: ActuatorFile = "thesis",
    method: Annotated[str, Parameter(help="hybrid, dragonfly or dragonfly-thesis.")] = "hybrid",
    model: Annotated[str, Parameter(help="Model to fit: averaged, monitor or reference.")] = "averaged",
    fitness: Annotated[
        str, Parameter(help="What a swarm minimises: least_squares, thesis or total_least_squares.")
    ] = "least_squares",
    correction: Annotated[
        bool, Parameter(help="Correct the model's bias by a few runs of the reference model (hybrid).")
    ] = True,
    report: Annotated[Path | None, Parameter(help="Write a report: .html.")] = None,
    seed: Seed = 0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Say which faults explain a recording, and how sure that is."""
    from emaphm.identification import diagnose as identify
    from emaphm.identification.correction import MOST_TURNS

    _check_seed(seed)
    _check_output(report, (".html",), force=force)
    described = _actuator(actuator)
    recorded = _recording(recording, described)
    with _progress("diagnosing", as_json) as advance:
        diagnosis = identify(
            recorded,
            described,
            method=method,
            model=model,
            fitness=fitness,
            turns=MOST_TURNS if correction else 0,
            seed=seed,
            on_progress=advance,
        )
    text = str(diagnosis)
    if report:
        from emaphm.report import write_report

        write_report(diagnosis, report, force=force)
        text += f"\nReport written to {report}"
    _print(diagnosis.to_dict(), text, as_json)


@app.command
def calibrate(
    recording: RecordingFile,
    *,
    free: Annotated[
        str, Parameter(help="Parameters to estimate, with commas between, e.g. inertia,viscous,coulomb.")
    ],
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="Calibrated TOML to write.")],
    actuator: ActuatorFile = "thesis",
    figure: FigureFile = None,
    seed: Seed = 0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Estimate physical parameters of a healthy unit, and write its calibrated description."""
    from emaphm.identification import calibrate as estimate
    from emaphm.recording.output import written_whole

    _check_seed(seed)
    _check_output(out, (".toml",), force=force)
    _check_output(figure, FIGURES, force=force)
    described = _actuator(actuator)
    recorded = _recording(recording, described)
    names = [name.strip() for name in free.split(",") if name.strip()]
    with _progress("calibrating", as_json) as advance:
        result = estimate(recorded, described, names, seed=seed, on_progress=advance)
    comments = (
        f"Calibrated on {recording.name}: {', '.join(names)}; the rest as in '{described.name}'.\n{result}"
    )
    with written_whole(out) as temporary:
        result.actuator.to_toml(temporary, comments=comments)
    text = f"{result}\n\nCalibrated description written to {out}"
    _draw(result, figure)
    _print(result.to_dict(), text, as_json)


@app.command
def replay(
    recording: RecordingFile,
    *,
    actuator: ActuatorFile = "thesis",
    model: Annotated[str, Parameter(help="averaged, monitor or reference.")] = "averaged",
    fault: FaultList = (),
    figure: FigureFile = None,
    seed: Seed = 0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Run a model on a recording's command and load, and compare it channel by channel."""
    from emaphm.identification import replay as rerun

    _check_seed(seed)
    _check_output(figure, FIGURES, force=force)
    described, faults = _actuator(actuator), _faults(fault)
    result = rerun(_recording(recording, described), described, faults=faults, model=model)
    _draw(result, figure)
    _print(result.to_dict(), str(result), as_json)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; return 0 when done, 2 for what the user can mend, 1 for a defect of ours."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without × or · is no reason to fail
    try:
        app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
        sys.stdout.flush()
    except EmaphmError as error:
        return _complain(str(error))
    except CycloptsError as error:
        return _complain(f"{' '.join(str(error).split())} See emaphm --help.")
    except KeyboardInterrupt:
        print("emaphm: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # The reader of a pipe left early (`emaphm … | head`): nothing more can be said to it.
        _discard_stdout()
    except OSError as error:
        if error.errno != errno.ENOSPC:
            raise
        _discard_stdout()
        return _complain("no space is left for the output; free some, or write elsewhere")
    return 0


def _discard_stdout() -> None:
    """Send what is still buffered nowhere, or the interpreter would fail on it when it exits."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _complain(text: str) -> int:
    line = "".join(c if c.isprintable() else " " for c in text)  # names may hold anything
    print(f"emaphm: {line}", file=sys.stderr)
    return 2


def _print(values: dict[str, Any], text: str, as_json: bool) -> None:
    print(json.dumps(values) if as_json else text)


def _check_seed(seed: int) -> None:
    if seed < 0:
        raise SignalError(f"--seed {seed} is negative; give 0 or more")


def _check_output(path: Path | None, endings: tuple[str, ...], *, force: bool) -> None:
    """Refuse an output that could not be written, before the work that it would be lost with."""
    from emaphm.recording import check_writable

    if path is not None:
        check_writable(path, force=force, endings=endings)


def _actuator(name: str) -> "Actuator":
    from emaphm.actuator import Actuator

    return Actuator.load(name)


def _recording(path: Path, actuator: "Actuator") -> Any:
    from emaphm.recording import read_recording

    return read_recording(path, actuator)


def _faults(assignments: tuple[str, ...]) -> "Faults":
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


def _command(name: str, amplitude: float, frequency: float | None, duration: float) -> "Command":
    from emaphm import actuator

    if not duration > 0:
        raise SignalError(f"--duration {duration:g}: give more than 0 s")
    if not (math.isfinite(amplitude) and math.isfinite(frequency or 0.0)):
        raise SignalError(
            f"the command is not finite with --amplitude {amplitude:g}, --frequency {frequency}; give numbers"
        )
    last = 15.0 if frequency is None else frequency
    makers: dict[str, Callable[[], Command]] = {
        "chirp": lambda: actuator.Chirp(amplitude, stop_hz=last, duration=duration),
        "decaying-chirp": lambda: actuator.DecayingChirp(amplitude, stop_hz=last, duration=duration),
        "step": lambda: actuator.Step(amplitude),
        "ramp": lambda: actuator.Ramp(amplitude / duration),
        "sine": lambda: actuator.Sine(amplitude, 4.0 if frequency is None else frequency),
    }
    if name in makers:
        return makers[name]()
    if not Path(name).suffix:
        raise SignalError(
            f"unknown command '{name}' (known: {', '.join(makers)}); or give a file such as command.csv"
        )
    return _signal(name, "command_rad", duration)


def _load(value: str, duration: float) -> "Load":
    try:
        return float(value)
    except ValueError:
        if not Path(value).suffix:
            raise SignalError(f"--load {value} is neither a number nor a file; give e.g. 0.05") from None
        return _signal(value, "load_Nm", duration)


def _signal(path: str, name: str, duration: float) -> "Command":
    from emaphm.recording import read_signal

    signal = read_signal(path, name)
    first, last = signal.time_s[0], signal.time_s[-1]
    if first >= duration or last <= 0:
        raise SignalError(
            f"{path}: time_s runs from {first:g} to {last:g} s, the simulation from 0 to {duration:g} s; "
            "shift the times to start at 0"
        )
    return signal


def _draw(result: Any, figure: Path | None) -> None:
    from emaphm.recording.output import written_whole

    if figure is not None:
        with written_whole(figure) as temporary:
            result.plot().savefig(temporary, format=figure.suffix[1:].lower(), dpi=150)


@contextmanager
def _progress(what: str, quiet: bool) -> "Iterator[Callable[[float], None] | None]":
    """Show a progress bar on stderr while the body runs, if a person is watching."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=1.0)
        yield lambda fraction: bar.update(task, completed=fraction)


if __name__ == "__main__":
    sys.exit(main())
