"""The verbs `demo`, `simulate` and `replay`: each reads its options, calls the library, and prints."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from emaphm.cli.options import (
    FIGURES,
    ActuatorFile,
    AsJson,
    Common,
    FaultList,
    FigureFile,
    Force,
    KnownList,
    Manoeuvre,
    RecordingFile,
    check_noise,
    check_output,
    check_seed,
    described_actuator,
    fault_vector,
    load_named,
    recording_of,
    whole_number,
)
from emaphm.cli.output import draw, progress, say, show

if TYPE_CHECKING:
    from emaphm.actuator import Actuator
    from emaphm.recording import Recording

AT_STOP = 1e-3
"""Distance from an end stop, relative to the travel, within which a shaft counts as starting at the stop."""


def demo(
    *,
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="Folder for the report.")] = Path("demo"),
    common: Common = Common(),  # noqa: B008 - frozen
) -> None:
    """Simulate a faulty actuator with noisy sensors, diagnose it, and print the estimates and true values."""
    from emaphm.demo import run_demo

    common.check()
    with progress("diagnosing", common.as_json) as advance:
        result = run_demo(out, seed=common.seed, force=common.force, on_progress=advance)
    common.show(result.to_dict(), str(result))


def simulate(
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="Recording to write: .csv or .parquet.")],
    *,
    model: Annotated[str, Parameter(help="Model to simulate: reference, monitor or averaged.")] = "reference",
    manoeuvre: Manoeuvre = Manoeuvre(),  # noqa: B008 - frozen
    fault: FaultList = (),
    noise: Annotated[float, Parameter(help="Sensor noise on the currents, rms [A].")] = 0.0,
    adc_bits: Annotated[
        int | None,
        Parameter(
            converter=whole_number,
            help="Resolution of the sensors' converters [bit], 4 to 24; no quantisation by default.",
        ),
    ] = None,
    load: Annotated[
        str,
        Parameter(
            help="Load at the motor [N·m; N if linear]: a number, or a file with the columns time_s and "
            "load_Nm."
        ),
    ] = "0",
    actuator: ActuatorFile = "thesis",
    common: Common = Common(),  # noqa: B008 - frozen
) -> None:
    """Simulate an actuator and write its recording."""
    from emaphm import simulated_recording
    from emaphm.output_files import TABLES
    from emaphm.recording import write_recording
    from emaphm.version import VERSION

    common.check((out, TABLES))
    described, faults = described_actuator(actuator), fault_vector(fault)
    check_noise(noise, described)
    driven = manoeuvre.command_for(described)
    with progress("simulating", common.as_json):
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
            seed=common.seed,
        )
    write_recording(recording, out, force=common.force)
    beyond = beyond_stops(recording, described)
    notes = [*manoeuvre.notes_on(driven), *([beyond] if beyond else [])]
    for note in () if common.as_json else notes:
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
        "seed": common.seed,
        "version": VERSION,
    }
    common.show(summary, f"{recording!r}\nwritten to {out}")


def beyond_stops(recording: "Recording", actuator: "Actuator") -> str | None:
    """Return a note if a simulated shaft was driven into an end stop, perhaps by mistake; otherwise None."""
    command, position = recording["command_rad"], recording["position_rad"]
    lowest, highest, stops = float(command.min()), float(command.max()), actuator.mechanics.end_stops
    if stops is None:
        return None
    if not actuator.mechanics.encloses(lowest, highest):
        return f"the command goes from {lowest:g} to {highest:g}; the end stops {list(stops)} limit the shaft"
    for stop, extreme in zip(stops, (position.min(), position.max()), strict=True):
        starts_at_stop = abs(position[0] - stop) < AT_STOP * (stops[1] - stops[0])
        if not stops[0] < extreme < stops[1] and not starts_at_stop:
            return f"the shaft runs into the end stop at {stop:g}, beyond the range of its command"
    return None


def replay(
    recording: RecordingFile,
    *further: RecordingFile,
    actuator: ActuatorFile = "thesis",
    model: Annotated[str, Parameter(help="Model to simulate: averaged, monitor or reference.")] = "averaged",
    fault: FaultList = (),
    known: KnownList = (),
    series: Annotated[
        Path | None,
        Parameter(help="Write time and all channels, measured and modelled: .csv or .parquet."),
    ] = None,
    figure: FigureFile = None,
    seed: Annotated[
        int,
        Parameter(
            converter=whole_number,
            help="Accepted as by the other verbs; without effect, because a replay has no random numbers.",
        ),
    ] = 0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Simulate a model with the command and load of recordings, and compare it with each recorded channel."""
    from emaphm.output_files import TABLES

    check_seed(seed)
    check_output(series, TABLES, force=force)
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
