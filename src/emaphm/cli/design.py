"""The verb that plans a test: the precision that a manoeuvre will give, and a better one."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from emaphm.cli.options import (
    FIGURES,
    ActuatorFile,
    Common,
    Manoeuvre,
    described_actuator,
    names_in,
    whole_number,
)
from emaphm.cli.output import draw, progress, say
from emaphm.errors import MethodError, SignalError

MOST_CANDIDATES, MOST_TESTS = 10_000, 1_000
"""Work that is begun: a candidate takes some milliseconds, a test some tenths of a second."""


@Parameter(name="*")
@dataclass(frozen=True)
class Largest:
    """What a better command may be at most."""

    max_amplitude: Annotated[
        float | None,
        Parameter(help="Largest command of a better one, at the user [rad]; as given if left out."),
    ] = None
    max_frequency: Annotated[
        float | None, Parameter(help="Its highest frequency [Hz]; as given if left out.")
    ] = None
    max_duration: Annotated[
        float | None, Parameter(help="Its longest duration [s]; as given if left out.")
    ] = None


@Parameter(name="*")
@dataclass(frozen=True)
class Effort:
    """How much is tried."""

    candidates: Annotated[
        int,
        Parameter(
            converter=whole_number,
            help="Chirps to try in search of a better one; 0 to report on the given one only.",
        ),
    ] = 48
    tests: Annotated[
        int,
        Parameter(
            converter=whole_number,
            help="Simulated tests that prove the given manoeuvre and the best found: 4 or more; 0 for no "
            "proof, with --candidates 0.",
        ),
    ] = 12

    def check(self, rows: float) -> None:
        """Refuse what would take more memory or time than there is; `rows` are those of a command."""
        from emaphm.recording.plausibility import MOST_ROWS

        if rows > MOST_ROWS:
            raise SignalError(
                f"--sample-rate and the duration make {rows:.3g} rows, {MOST_ROWS:,} are possible; "
                "sample slower"
            )
        for option, number, most in (
            ("--candidates", self.candidates, MOST_CANDIDATES),
            ("--tests", self.tests, MOST_TESTS),
        ):
            if number > most:
                raise MethodError(f"{option} {number} would take too long; give {most:,} or fewer")


def design(
    *,
    actuator: ActuatorFile = "thesis",
    manoeuvre: Manoeuvre = Manoeuvre(),  # noqa: B008 - frozen
    largest: Largest = Largest(),
    channels: Annotated[
        str,
        Parameter(
            help="What will be recorded, with commas between: current, voltage, position, speed; or columns "
            "such as current_A."
        ),
    ] = "current",
    noise: Annotated[float, Parameter(help="Noise of the current's sensor, rms [A].")] = 0.05,
    effort: Effort = Effort(),
    out: Annotated[
        Path | None,
        Parameter(
            name=("--out", "-o"), help="Command found (the given one if none is better), to write: .csv."
        ),
    ] = None,
    figure: Annotated[
        Path | None, Parameter(help="Draw commands and intervals, given and found: .png, .svg or .pdf.")
    ] = None,
    common: Common = Common(),  # noqa: B008 - frozen
) -> None:
    """Say before a test how well its manoeuvre will identify each fault, and find a better manoeuvre."""
    from emaphm.experiment import design as plan
    from emaphm.output_files import written_whole

    common.check((out, (".csv",)), (figure, FIGURES))
    described = described_actuator(actuator)
    effort.check(manoeuvre.sample_rate * max(manoeuvre.duration, largest.max_duration or 0.0))
    if noise > described.controller.current_limit:
        raise SignalError(
            f"--noise {noise:g} A exceeds the current limit of {described.controller.current_limit:g} A; "
            "give the rms of the sensor's noise"
        )
    driven = manoeuvre.command_for(described)
    if not common.as_json and (jump := manoeuvre.jump_of(driven)):
        say(jump)
    with progress("designing", common.as_json) as advance:
        result = plan(
            described,
            driven,
            duration=manoeuvre.duration,
            initial_position=manoeuvre.about,
            max_amplitude=largest.max_amplitude,
            max_frequency=largest.max_frequency,
            max_duration=largest.max_duration,
            channels=names_in(channels),
            noise=noise,
            sample_rate=manoeuvre.sample_rate,
            candidates=effort.candidates,
            tests=effort.tests,
            seed=common.seed,
            on_progress=advance,
        )
    text = str(result)
    if out is not None:
        with written_whole(out) as temporary:
            result.write_command(temporary)
        text += f"\n\nCommand written to {out}; {result.found.excitation.played(described.coordinates)}."
    common.show(result.to_dict(), text)
    draw(result, figure)
