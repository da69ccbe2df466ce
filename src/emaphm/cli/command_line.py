"""The command line as a whole: its verbs, and how it ends."""

import io
import os
import sys
from typing import Annotated, Literal

from cyclopts import App, CycloptsError, Parameter

from emaphm.cli import detect, study, verbs
from emaphm.cli.calibrate import calibrate
from emaphm.cli.design import design
from emaphm.cli.diagnose import diagnose
from emaphm.cli.doctor import doctor
from emaphm.cli.init import init
from emaphm.cli.interruption import exit_code, is_interrupted
from emaphm.cli.output import UNWRITABLE, discard_stdout, lose_stdout, reason_lost, say, show
from emaphm.cli.segment import segment
from emaphm.cli.split import split
from emaphm.cli.train import train
from emaphm.cli.units import fleet, history
from emaphm.cli.units.limits import limits
from emaphm.cli.units.prognose import prognose
from emaphm.cli.units.serve import serve
from emaphm.cli.units.watch import watch
from emaphm.cli.wrong_use import wrong_use
from emaphm.errors import EmaphmError

LONGEST_LINE = 1200
"""Longest complaint; a longer one quotes an argument or a name that nobody would read."""


def _version() -> str:
    from emaphm.version import VERSION

    return VERSION


app = App(
    name="emaphm",
    help="Faults of an electromechanical actuator, identified from a recording.",
    version=_version,
    help_format="plaintext",  # a parser of Markdown takes longer to import than all else of --help
    suppress_keyboard_interrupt=False,
)


def completion(
    shell: Annotated[Literal["bash", "zsh", "fish"], Parameter(help="bash, zsh or fish.")],
) -> None:
    """Print what completes the command's verbs and options; for bash: eval "$(emaphm completion bash)"."""
    show({}, app.generate_completion(shell=shell), as_json=False)


VERBS = (
    verbs.demo,
    init,
    verbs.simulate,
    diagnose,
    calibrate,
    verbs.replay,
    design,
    segment,
    split,
    limits,
    prognose,
    train,
    watch,
    serve,
    doctor,
    completion,
)
for verb in VERBS:
    app.command(verb)
app.command(detect.app)
app.command(study.app)
app.command(history.app)
app.command(fleet.app)


def run(arguments: list[str]) -> int:
    """Run a command line; return 0 when done, 2 for what the user can correct, else `exit_code`."""
    try:
        return _run(arguments)
    except KeyboardInterrupt as error:
        return _interrupted(*error.args)
    except Exception:
        if is_interrupted():  # a library has made another error of it
            return _interrupted()
        raise


def _interrupted(*said: object) -> int:
    _flush()
    say(": ".join(["interrupted", *map(str, said)]))
    return exit_code()


def _run(arguments: list[str]) -> int:
    if not _prepare_streams():
        return _complain("stdout is closed, nothing could be answered; redirect it, to /dev/null at least")
    reason_lost()
    try:
        for argument in arguments:
            if "\0" in argument:
                return _complain(f"argument {argument!r} holds a null character; leave it out")
        app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
    except EmaphmError as error:
        if is_interrupted():  # say, that a worker died: SIGTERM came to all processes
            raise
        _flush()
        return _complain(str(error))
    except CycloptsError as error:
        return _complain(wrong_use(error))
    except SystemExit:  # what prints --help makes one of a reader that has left
        discard_stdout()
    except OSError as error:  # of what prints --help
        if error.errno not in UNWRITABLE or error.filename is not None:
            raise
        lose_stdout(error)
    _flush()
    reason = reason_lost()
    return 0 if reason is None else _complain(f"stdout cannot be written: {reason}; write elsewhere")


def _flush() -> None:
    """Print what is still buffered, and drop it where that fails."""
    try:
        sys.stdout.flush()
    except OSError as error:
        lose_stdout(error)


def _prepare_streams() -> bool:
    """Make the streams fit for any text; return whether there is a stdout to answer on."""
    has_stdout = sys.stdout is not None
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            # Else the next file that is opened would get this number, and what is meant for the stream.
            os.open(os.devnull, os.O_RDWR)
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: PTH123, SIM115 - open until the end
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without × or · is no reason to fail
    return has_stdout


def _complain(text: str) -> int:
    line = "".join(c if c.isprintable() else " " for c in text)  # names may hold anything
    if len(line) > LONGEST_LINE:
        line = f"{line[: LONGEST_LINE // 2]} … {line[-LONGEST_LINE // 2 :]}"
    say(line)
    return 2
