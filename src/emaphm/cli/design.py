"""The verb that plans a test: what a manoeuvre is expected to tell, and a better one."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from emaphm.cli.options import (
    FIGURES,
    ActuatorFile,
    AsJson,
    Force,
    Seed,
    check_output,
    check_seed,
    described_actuator,
    names_in,
)
from emaphm.cli.output import draw, progress, show


def design(
    *,
    actuator: ActuatorFile = "thesis",
    max_amplitude: Annotated[float, Parameter(help="Largest command, at the user [rad].")] = 5e-3,
    max_frequency: Annotated[float, Parameter(help="Highest frequency of the command [Hz].")] = 15.0,
    max_duration: Annotated[float, Parameter(help="Longest manoeuvre [s].")] = 0.5,
    channels: Annotated[
        str,
        Parameter(help="What will be recorded, with commas between: current, voltage, position, speed."),
    ] = "current",
    noise: Annotated[float, Parameter(help="Noise of the current's sensor, rms [A].")] = 0.05,
    sample_rate: Annotated[float, Parameter(help="Rows a second [Hz].")] = 5000.0,
    out: Annotated[
        Path | None, Parameter(name=("--out", "-o"), help="Command found, to write: .csv.")
    ] = None,
    figure: Annotated[
        Path | None, Parameter(help="Draw commands and expected intervals: .png, .svg or .pdf.")
    ] = None,
    seed: Seed = 0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Say before a test how well its manoeuvre will tell each fault, and find a better manoeuvre."""
    from emaphm.identification import design as plan
    from emaphm.recording.output import written_whole

    check_seed(seed)
    check_output(out, (".csv",), force=force)
    check_output(figure, FIGURES, force=force)
    described = described_actuator(actuator)
    with progress("designing", as_json) as advance:
        result = plan(
            described,
            max_amplitude=max_amplitude,
            max_frequency=max_frequency,
            max_duration=max_duration,
            channels=names_in(channels),
            noise=noise,
            sample_rate=sample_rate,
            seed=seed,
            on_progress=advance,
        )
    text = str(result)
    if out is not None:
        with written_whole(out) as temporary:
            result.write_command(temporary)
        text += f"\n\nCommand written to {out}"
    draw(result, figure)
    show(result.to_dict(), text, as_json)
