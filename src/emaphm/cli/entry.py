"""Where the command begins. It imports nothing slow, so that an early interruption shows no traceback."""

import signal
import sys
from typing import TYPE_CHECKING

from emaphm.cli.interruption import awaited, exit_code, interrupt, print_no_lost_one

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable


def main(arguments: list[str] | None = None) -> int:
    """Run a command line, this process's own where none is given.

    Returns
    -------
    0 when done, 2 for what the user can correct, 1 for a defect of ours, 130 when interrupted, 143 when that
    was by SIGTERM.
    """
    if arguments is not None:
        from emaphm.cli.command_line import run

        return run(arguments)
    signals = awaited()
    try:
        # Ends the process at once: Python would print where in an import it was.
        _handle(signals, signal.SIG_DFL)
        from emaphm.cli.command_line import run

        print_no_lost_one()
        _handle(signals, interrupt)
        code = run(sys.argv[1:])
        _handle(signals, signal.SIG_DFL)
    except KeyboardInterrupt:  # between two of these lines
        return exit_code()
    return code


def _handle(signals: "Iterable[int]", how: "Callable[..., None] | signal.Handlers") -> None:
    for number in signals:
        signal.signal(number, how)
