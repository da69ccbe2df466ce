"""Where the command begins. It imports nothing slow, so that an early interruption shows no traceback."""

import signal
import sys

from emaphm.cli.interruption import interrupt, is_wanted, print_no_lost_one

INTERRUPTED = 130
"""Exit code of a command that was interrupted, as shells give it."""


def main(arguments: list[str] | None = None) -> int:
    """Run a command line, this process's own where none is given.

    Returns
    -------
    0 when done, 2 for what the user can correct, 1 for a defect of ours, 130 when interrupted.
    """
    if arguments is not None:
        from emaphm.cli.main import run

        return run(arguments)
    interruptible = is_wanted()
    try:
        if interruptible:
            # Ends the process at once: Python would print where in an import it was.
            signal.signal(signal.SIGINT, signal.SIG_DFL)
        from emaphm.cli.main import run

        if interruptible:
            print_no_lost_one()
            signal.signal(signal.SIGINT, interrupt)
        code = run(sys.argv[1:])
        if interruptible:
            signal.signal(signal.SIGINT, signal.SIG_DFL)
    except KeyboardInterrupt:  # between two of these lines
        return INTERRUPTED
    return code
