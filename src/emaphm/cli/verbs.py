"""The verbs on one recording: each parses, calls the library, and prints."""

import math
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from emaphm.cli.detect import healthy_check
from emaphm.cli.manoeuvre import Manoeuvre
from emaphm.cli.options import (
    FIGURES,
    ActuatorFile,
    AsJson,
    By,
    Fast,
    FaultList,
    FigureFile,
    Force,
    KnownList,
    RecordingFile,
    RecordingsAt,
    Scheduler,
    Seed,
    Workers,
    check_fast,
    check_output,
    check_seed,
    check_workers,
    described_actuator,
    fault_vector,
    load_named,
    recording_of,
    whole_number,
)
from emaphm.cli.output import draw, progress, say, show
from emaphm.errors import MethodError, SignalError

if TYPE_CHECKING:
    from collections.abc import Callable

    from emaphm.actuator import Actuator
    from emaphm.fleet import DiagnosisSettings
    from emaphm.recording import Recording


AT_STOP = 1e-3
"""Distance from an end stop, of the travel, within which a shaft starts there."""


def demo(
    *,
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="Folder for the report.")] = Path("demo"),
    seed: Seed = 0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Simulate a faulty actuator with noisy sensors, diagnose it, and print estimates with true values."""
    from emaphm.demo import run_demo

    check_seed(seed)
    with progress("diagnosing", as_json) as advance:
        result = run_demo(out, seed=seed, force=force, on_progress=advance)
    show(result.to_dict(), str(result), as_json)


def simulate(
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="Recording to write: .csv or .parquet.")],
    *,
    model: Annotated[str, Parameter(help="reference, monitor or averaged.")] = "reference",
    manoeuvre: Manoeuvre = Manoeuvre(),  # noqa: B008 - frozen
    fault: FaultList = (),
    noise: Annotated[float, Parameter(help="Sensor noise on the currents, rms [A].")] = 0.0,
    adc_bits: Annotated[
        int | None, Parameter(converter=whole_number, help="Resolution of the sensors' converters.")
    ] = None,
    load: Annotated[
        str, Parameter(help="At the motor [N·m]: a number, or a file with time_s and load_Nm.")
    ] = "0",
    actuator: ActuatorFile = "thesis",
    seed: Seed = 0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Simulate an actuator and write its recording."""
    from emaphm import simulated_recording
    from emaphm.output_files import check_writable
    from emaphm.recording import write_recording
    from emaphm.recording.io.write import ENDINGS
    from emaphm.version import VERSION

    check_seed(seed)
    check_writable(out, force=force, endings=ENDINGS)
    if not 0 <= noise < math.inf:
        raise SignalError(f"--noise {noise:g} is no rms; give 0 or more")
    described, faults = described_actuator(actuator), fault_vector(fault)
    driven = manoeuvre.command_for(described)
    with progress("simulating", as_json):
        recording = simulated_recording.simulate(
            described,
            driven,
            faults=faults,
            model=model,
            duration=manoeuvre.duration,
            sample_rate=manoeuvre.sample_rate,
            load=load_named(load, manoeuvre.duration),
            noise=noise,
            adc_bits=adc_bits,
            sampling=described.channels.sampling,
            initial_position=manoeuvre.about,
            seed=seed,
        )
    write_recording(recording, out, force=force)
    notes = [note for note in (manoeuvre.jump_of(driven), beyond_stops(recording, described)) if note]
    for note in () if as_json else notes:
        say(note)
    summary = {
        "recording": str(out),
        "samples": recording.samples,
        "duration_s": recording.duration_s,
        "sample_rate_hz": recording.sample_rate_hz,
        "channels": list(recording.names),
        "model": model,
        "k": faults.vector.tolist(),
        "actuator": described.name,
        "notes": notes,
        "seed": seed,
        "version": VERSION,
    }
    show(summary, f"{recording!r}\nwritten to {out}", as_json)


def beyond_stops(recording: "Recording", actuator: "Actuator") -> str | None:
    """Return that a simulated shaft was driven into an end stop, which may not be meant, None otherwise."""
    command, position = recording["command_rad"], recording["position_rad"]
    lowest, highest, stops = float(command.min()), float(command.max()), actuator.mechanics.end_stops
    if stops is None:
        return None
    if not actuator.mechanics.encloses(lowest, highest):
        return f"the command goes from {lowest:g} to {highest:g}; the end stops {list(stops)} hold the shaft"
    for stop, farthest in zip(stops, (position.min(), position.max()), strict=True):
        starts_there = abs(position[0] - stop) < AT_STOP * (stops[1] - stops[0])
        if not stops[0] < farthest < stops[1] and not starts_there:
            return f"the shaft runs into the end stop at {stop:g}, beyond its command"
    return None


def diagnose(
    recording: RecordingsAt,
    *further: RecordingsAt,
    actuator: ActuatorFile = "thesis",
    method: Annotated[
        str,
        Parameter(
            help="hybrid; genetic, particle-swarm, differential-evolution, grey-wolf, dragonfly (or ga, pso, "
            "de, gwo, da), dragonfly-thesis, random; cma-es, l-shade, scipy-de, pymoo-NAME. Any but hybrid "
            "may end in +lsq: it finds the starts, least squares do the rest."
        ),
    ] = "hybrid",
    model: Annotated[str, Parameter(help="Model to fit: averaged, monitor or reference.")] = "averaged",
    fitness: Annotated[
        str, Parameter(help="What an optimiser minimises: least_squares, thesis or total_least_squares.")
    ] = "least_squares",
    correction: Annotated[
        bool, Parameter(help="Correct the model's bias by a few runs of the reference model (hybrid, +lsq).")
    ] = True,
    nuisance: Annotated[
        str | None,
        Parameter(
            help="What is estimated with the faults, with commas between: load, hinge, load_variation, "
            "temperature, supply, inertia, delay, current_offset, current_scale, current_drift, "
            "current_delay, and the same of voltage, position and speed; or 'none'. As the TOML says if "
            "left out, and what deviates significantly."
        ),
    ] = None,
    posterior: Annotated[
        bool,
        Parameter(
            negative="",
            help="Sample the posterior too, for estimates at a bound: 5 to 20 times as long as the search, "
            "minutes where a recording has thousands of rows.",
        ),
    ] = False,
    estimator: Annotated[
        Path | None,
        Parameter(
            help="Begin where an estimator of 'emaphm train' says, in place of a search of all the range."
        ),
    ] = None,
    fast: Fast = False,
    healthy: Annotated[
        Path | None,
        Parameter(help="Also say whether the recording is like healthy ones: a file of 'detect learn'."),
    ] = None,
    by: By = None,
    known: KnownList = (),
    report: Annotated[Path | None, Parameter(help="Write a report of one recording: .html.")] = None,
    joint: Annotated[
        bool,
        Parameter(negative="", help="One estimate of the faults of one unit, from all its recordings."),
    ] = False,
    workers: Workers = None,
    scheduler: Scheduler = None,
    out: Annotated[
        Path | None,
        Parameter(
            name=("--out", "-o"),
            help="Folder that keeps the results of several recordings as they finish; the same command goes "
            "on where it stopped.",
        ),
    ] = None,
    seed: Seed = 0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Say which faults explain a recording, and how sure that is; of several, each in a row of a table.

    With --json, several recordings are one line of JSON each, in the order given.
    """
    check_seed(seed)
    check_output(report, (".html",), force=force)
    described = described_actuator(actuator)
    check_fast(fast, estimator)
    check_workers(workers, scheduler)
    from emaphm.cli import batch

    asked = partial(
        batch.settings,
        method=method,
        model=model,
        fitness=fitness,
        correction=correction,
        nuisance=nuisance,
        posterior=posterior,
        estimator=None if estimator is None else str(estimator),
        fast=fast,
        seed=seed,
    )
    if not (joint or further or workers or scheduler or out or by or recording.is_dir()):
        _diagnose_one(recording, described, asked, known, healthy, report, force=force, as_json=as_json)
        return
    if report:
        raise MethodError("--report is of one recording; diagnose that one alone, without --joint")
    if healthy:
        raise MethodError("--healthy is for one recording; judge several by 'emaphm detect judge'")
    settings, files, paths = asked(), batch.reading(by, known), (recording, *further)
    if joint:
        batch.check_joint(settings, workers, scheduler, out)
        batch.diagnose_joint(paths, described, settings, files, as_json)
    else:
        batch.diagnose_each(paths, described, settings, files, workers, scheduler, out, as_json)


def _diagnose_one(
    recording: Path,
    described: "Actuator",
    asked: "Callable[[], DiagnosisSettings]",
    known: tuple[str, ...],
    healthy: Path | None,
    report: Path | None,
    *,
    force: bool,
    as_json: bool,
) -> None:
    recorded = recording_of(recording, described, known)
    check = None if healthy is None else healthy_check(healthy, recorded)
    # Not before: what cannot be read is refused without waiting for a compiler to be loaded.
    settings = asked()
    with progress("diagnosing", as_json) as advance:
        diagnosis = settings.diagnosed(recorded, described, workers=None, on_progress=advance)
    diagnosis = replace(diagnosis, healthy_check=check)
    # First: a full disk must not take the answer too.
    show(diagnosis.to_dict(), str(diagnosis), as_json)
    if report:
        from emaphm.report import write_report

        write_report(diagnosis, report, force=force)
        if not as_json:
            show({}, f"Report written to {report}", as_json)


def replay(
    recording: RecordingFile,
    *further: RecordingFile,
    actuator: ActuatorFile = "thesis",
    model: Annotated[str, Parameter(help="averaged, monitor or reference.")] = "averaged",
    fault: FaultList = (),
    known: KnownList = (),
    series: Annotated[
        Path | None, Parameter(help="Write time and each channel, measured and modelled: .csv or .parquet.")
    ] = None,
    figure: FigureFile = None,
    seed: Seed = 0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Run a model on the command and load of recordings, and compare it channel by channel."""
    check_seed(seed)
    check_output(series, (".csv", ".parquet"), force=force)
    check_output(figure, FIGURES, force=force)
    described, faults = described_actuator(actuator), fault_vector(fault)
    recorded = [recording_of(path, described, known) for path in (recording, *further)]
    from emaphm.estimation.replay import replay_all, write_series

    result = replay_all(recorded, described, faults=faults, model=model)
    if series:
        write_series(result.replays, series, force=force)
    text = str(result) + (f"\nSignals written to {series}" if series else "")
    show(result.to_dict(), text, as_json)
    draw(result, figure)
