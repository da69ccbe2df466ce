"""The verb `design`: the precision expected from a manoeuvre, and the search for a better manoeuvre."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from emaphm.cli.options import (
    FIGURES,
    ActuatorFile,
    Common,
    Manoeuvre,
    check_noise,
    described_actuator,
    names_in,
    whole_number,
)
from emaphm.cli.output import draw, progress, say
from emaphm.errors import MethodError, SignalError

MOST_CANDIDATES, MOST_TESTS = 10_000, 1_000
"""Largest accepted numbers: a candidate takes some milliseconds, a test some tenths of a second."""


@Parameter(name="*")
@dataclass(frozen=True)
class CommandLimits:
    """Upper limits for the commands of the search."""

    max_amplitude: Annotated[
        float | None,
        Parameter(
            help="Largest amplitude of a better command, at the user [rad; m if linear]; default as in the "
            "given command."
        ),
    ] = None
    max_frequency: Annotated[
        float | None,
        Parameter(help="Highest frequency of a better command [Hz]; default as in the given command."),
    ] = None
    max_duration: Annotated[
        float | None,
        Parameter(help="Longest duration of a better command [s]; default as in the given command."),
    ] = None


@Parameter(name="*")
@dataclass(frozen=True)
class Effort:
    """Numbers of candidates and of simulated tests."""

    candidates: Annotated[
        int,
        Parameter(
            converter=whole_number,
            help="Number of chirps tried in the search for a better command; 0 evaluates the given command "
            "only.",
        ),
    ] = 48
    tests: Annotated[
        int,
        Parameter(
            converter=whole_number,
            help="Number of simulated tests with random faults, which check the predictions for the given "
            "and the best manoeuvre: 4 or more; 0 omits the check, and needs --candidates 0.",
        ),
    ] = 12

    def check(self, rows: float) -> None:
        """Refuse numbers that need too much time, or `rows` of a command that need too much memory."""
        from emaphm.recording.plausibility import MOST_ROWS

        if rows > MOST_ROWS:
            raise SignalError(
                f"--sample-rate and the duration give {rows:.3g} rows, {MOST_ROWS:,} are possible; "
                "give a lower --sample-rate"
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
    largest: CommandLimits = CommandLimits(),
    channels: Annotated[
        str,
        Parameter(
            help="Channels that will be recorded, separated by commas: current, voltage, position, speed, or "
            "columns such as current_A."
        ),
    ] = "current",
    noise: Annotated[float, Parameter(help="Noise of the current sensor, rms [A].")] = 0.05,
    effort: Effort = Effort(),
    out: Annotated[
        Path | None,
        Parameter(
            name=("--out", "-o"),
            help="Write the best command (the given command if no other is better): .csv.",
        ),
    ] = None,
    figure: Annotated[
        Path | None,
        Parameter(
            help="Write a figure of the given and the best command, with intervals: .png, .svg or .pdf."
        ),
    ] = None,
    common: Common = Common(),  # noqa: B008 - frozen
) -> None:
    """Predict how well a manoeuvre will identify each fault, and search for a better manoeuvre."""
    from emaphm.experiment import design as plan

    common.check((out, (".csv",)), (figure, FIGURES))
    described = described_actuator(actuator)
    effort.check(manoeuvre.sample_rate * max(manoeuvre.duration, largest.max_duration or 0.0))
    check_noise(noise, described)
    driven = manoeuvre.command_for(described)
    for note in () if common.as_json else manoeuvre.notes_on(driven):
        say(note)
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
        result.write_command(out)
        text += f"\n\nCommand written to {out}; {result.found.excitation.played(described.coordinates)}."
    common.show(result.to_dict(), text)
    draw(result, figure)
