"""The verb `init`: a first description of an actuator, from a few questions or a built-in description."""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from emaphm.cli.options import AsJson, Force, check_output
from emaphm.cli.output import say_plainly, show
from emaphm.errors import ActuatorError, SignalError


def init(
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="Description to write: .toml.")],
    *,
    machine: Annotated[
        str | None,
        Parameter(
            name="--from",
            help="Built-in description to write without questions: bldc (or thesis), six-step, pmsm or dc.",
        ),
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Write a commented description of an actuator, to be completed and then calibrated."""
    from emaphm.first_description import ENDING, HEADING, MACHINES, interview, machine_named, template

    check_output(out, (".toml",), force=force)
    answers = 0
    if machine is not None:
        machine = machine_named(machine)
        described = template(machine)
    else:
        say_plainly(
            "An empty answer keeps the value in brackets; all values can be changed in the file later."
        )
        width = max(map(len, MACHINES))
        for name, (_, meaning) in MACHINES.items():
            say_plainly(f"  {name:{width}}  {meaning}")
        machine = _ask_machine()
        described, answers = interview(template(machine), _ask, say_plainly)
    heading = HEADING.format(name=described.name, machine=machine, meaning=MACHINES[machine][1])
    described.to_toml(out, comments=heading, ending=ENDING)
    unit = out.with_name(f"{out.stem}-calibrated.toml")
    text = (
        f"{out} written. Correct the values for which you have data. Then design a command that identifies "
        "the faults:\n"
        f"  emaphm design --actuator {out} --out command.csv\n"
        "Calibrate with recordings of the healthy unit:\n"
        f"  emaphm calibrate healthy.csv --actuator {out} --free inertia,coulomb,viscous -o {unit}\n"
        "Diagnose the recordings of its flights:\n"
        f"  emaphm diagnose flight.csv --actuator {unit}"
    )
    answer = {"actuator": str(out), "name": described.name, "machine": machine, "answers": answers}
    show(answer, text, as_json)


def _ask_machine() -> str:
    """Ask for the kind of machine until the answer is valid; return it."""
    from emaphm.first_description import machine_named

    while True:
        try:
            return machine_named(_ask("kind of machine", "bldc").strip() or "bldc")
        except ActuatorError as error:
            say_plainly(str(error))


def _ask(question: str, present: str) -> str:
    """Ask a question on stderr, which carries no results, and return the answer from stdin."""
    say_plainly(f"{question} ({present}): ", end="")
    line = sys.stdin.readline() if sys.stdin else ""
    if not line:
        raise SignalError(
            "init: the answers ended before the questions, and nothing was written; answer all questions, or "
            "give --from bldc, six-step, pmsm or dc"
        )
    return line
