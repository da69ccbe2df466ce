"""The command line as a whole: its verbs, and how it ends."""

import errno
import io
import os
import sys

from cyclopts import App, CycloptsError

from emaphm.cli import study, verbs
from emaphm.cli.design import design
from emaphm.errors import EmaphmError
from emaphm.version import VERSION

app = App(
    name="emaphm",
    help="Faults of an electromechanical actuator, identified from a recording.",
    version=VERSION,
    suppress_keyboard_interrupt=False,
)
for verb in (verbs.demo, verbs.simulate, verbs.diagnose, verbs.calibrate, verbs.replay, design):
    app.command(verb)
app.command(study.app)


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
    except KeyboardInterrupt as error:
        print(": ".join(["emaphm: interrupted", *error.args]), file=sys.stderr)
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
