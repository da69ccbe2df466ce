"""Entry point of the command. It imports nothing slow, so an early interruption prints no traceback."""

import signal
import sys
from typing import TYPE_CHECKING

from emaphm.cli.interruption import exit_code, handled_signals, hide_lost_interruptions, interrupt

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable


def main(arguments: list[str] | None = None) -> int:
    """Run a command line; by default, the arguments of this process.

    Returns
    -------
    0 when done, 2 for an error that the user can correct, 1 for a defect of the program, 130 when
    interrupted, 143 when interrupted by SIGTERM.
    """
    if arguments is not None:
        from emaphm.cli.command_line import run

        return run(arguments)
    signals = handled_signals()
    try:
        # During imports, a signal ends the process at once: Python would print a traceback.
        _handle(signals, signal.SIG_DFL)
        from emaphm.cli.command_line import run

        hide_lost_interruptions()
        _handle(signals, interrupt)
        code = run(sys.argv[1:])
        _handle(signals, signal.SIG_DFL)
    except KeyboardInterrupt:  # outside of `run`, between two of the lines above
        return exit_code()
    return code


def _handle(signals: "Iterable[int]", handler: "Callable[..., None] | signal.Handlers") -> None:
    for number in signals:
        signal.signal(number, handler)
