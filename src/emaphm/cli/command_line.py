"""The application `emaphm`: its verbs, and the exit status and message of each way in which it can end."""

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
"""Longest error message [characters]; a longer one quotes an argument or name that is cut in the middle."""


def _version() -> str:
    from emaphm.version import VERSION

    return VERSION


app = App(
    name="emaphm",
    help="Diagnose and predict faults of electromechanical actuators from their recordings.",
    version=_version,
    help_format="plaintext",  # importing a Markdown parser takes longer than the rest of --help
    suppress_keyboard_interrupt=False,
)


def completion(
    shell: Annotated[Literal["bash", "zsh", "fish"], Parameter(help="Shell: bash, zsh or fish.")],
) -> None:
    """Print a completion script for verbs and options; for bash: eval "$(emaphm completion bash)"."""
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
    """Run a command line; return 0 when done, 2 for an error of the user, `exit_code` if interrupted."""
    try:
        return _run(arguments)
    except KeyboardInterrupt as error:
        return _report_interruption(*error.args)
    except Exception:
        if is_interrupted():  # a library has turned the interruption into another error
            return _report_interruption()
        raise


def _report_interruption(*hints: object) -> int:
    """Print that the command was interrupted, with hints on how to resume; return the exit code."""
    _flush()
    say(": ".join(["interrupted", *map(str, hints)]))
    return exit_code()


def _run(arguments: list[str]) -> int:
    if not _prepare_streams():
        return _report_error("stdout is closed, so no result can be printed; redirect it, e.g. to /dev/null")
    reason_lost()
    try:
        for argument in arguments:
            if "\0" in argument:
                return _report_error(f"argument {argument!r} contains a null character; leave it out")
        app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
    except EmaphmError as error:
        if is_interrupted():  # e.g. a dead worker, because SIGTERM was sent to all processes
            raise
        _flush()
        return _report_error(str(error))
    except CycloptsError as error:
        return _report_error(wrong_use(error))
    except SystemExit:  # the printer of --help raises it when the reader of the pipe has left
        discard_stdout()
    except OSError as error:  # raised by the printer of --help
        if error.errno not in UNWRITABLE or error.filename is not None:
            raise
        lose_stdout(error)
    _flush()
    reason = reason_lost()
    return 0 if reason is None else _report_error(f"stdout cannot be written: {reason}; write elsewhere")


def _flush() -> None:
    """Print the buffered output, and drop it if that fails."""
    try:
        sys.stdout.flush()
    except OSError as error:
        lose_stdout(error)


def _prepare_streams() -> bool:
    """Make the streams accept any text; return whether stdout is open."""
    has_stdout = sys.stdout is not None
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            # Otherwise the next file opened would get this number, and the output meant for the stream.
            os.open(os.devnull, os.O_RDWR)
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: PTH123, SIM115 - open until the end
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that cannot show × or · must not fail
    return has_stdout


def _report_error(text: str) -> int:
    """Print an error message as one line on stderr; return exit code 2."""
    line = "".join(c if c.isprintable() else " " for c in text)  # names may contain any character
    if len(line) > LONGEST_LINE:
        line = f"{line[: LONGEST_LINE // 2]} … {line[-LONGEST_LINE // 2 :]}"
    say(line)
    return 2
