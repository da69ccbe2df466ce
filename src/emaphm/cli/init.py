"""`emaphm init`: a first description of an actuator, from few questions or from a built-in one."""

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
            name="--from", help="bldc (or thesis), six-step, pmsm or dc: write that one, without questions."
        ),
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Write a commented description of an actuator, to be completed and calibrated."""
    from emaphm.first_description import ENDING, HEADING, MACHINES, interview, machine_named, template

    check_output(out, (".toml",), force=force)
    answers = 0
    if machine is not None:
        machine = machine_named(machine)
        described = template(machine)
    else:
        say_plainly("An empty answer keeps the value in brackets; it can be changed in the file at any time.")
        width = max(map(len, MACHINES))
        for name, (_, meaning) in MACHINES.items():
            say_plainly(f"  {name:{width}}  {meaning}")
        machine = _machine()
        described, answers = interview(template(machine), _ask, say_plainly)
    heading = HEADING.format(name=described.name, machine=machine, meaning=MACHINES[machine][1])
    described.to_toml(out, comments=heading, ending=ENDING)
    unit = out.with_name(f"{out.stem}-calibrated.toml")
    text = (
        f"{out} written. Correct what you have data for. Then, for a command that shows the faults,\n"
        f"  emaphm design --actuator {out} --out command.csv\n"
        "on recordings of the healthy unit,\n"
        f"  emaphm calibrate healthy.csv --actuator {out} --free inertia,coulomb,viscous -o {unit}\n"
        "and on those of its flights\n"
        f"  emaphm diagnose flight.csv --actuator {unit}"
    )
    answer = {"actuator": str(out), "name": described.name, "machine": machine, "answers": answers}
    show(answer, text, as_json)


def _machine() -> str:
    from emaphm.first_description import machine_named

    while True:
        try:
            return machine_named(_ask("kind of machine", "bldc").strip() or "bldc")
        except ActuatorError as error:
            say_plainly(str(error))


def _ask(question: str, present: str) -> str:
    """Return the line that answers; the question goes to stderr, where no answer of ours is expected."""
    say_plainly(f"{question} ({present}): ", end="")
    line = sys.stdin.readline() if sys.stdin else ""
    if not line:
        raise SignalError(
            "init: the answers ended before the questions, and nothing was written; answer them all, or give "
            "--from bldc, six-step, pmsm or dc"
        )
    return line
