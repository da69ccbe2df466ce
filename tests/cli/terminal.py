"""Programs with stderr on a terminal, forked from a process that has loaded the modules of `emaphm`.

Used by tests that do not check the start of the program: the start takes five times as long as most runs.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

PATIENCE_S = 120
"""Time limit; long enough to compile the kernels for the first time on a busy machine."""

# Polars must not be used before a fork: its threads would be missing in the child.
FORKS = """
import json, os, sys
import emaphm.calibration, emaphm.cli.verbs, emaphm.diagnosis, emaphm.fleet, emaphm.recording, emaphm.report
import polars, rich.progress
from emaphm.cli import main

for line in sys.stdin:
    order = json.loads(line)
    streams = [
        os.open(name, how | os.O_NOCTTY, 0o600)
        for name, how in (
            (os.devnull, os.O_RDONLY), (order["out"], os.O_CREAT | os.O_WRONLY), (order["err"], os.O_RDWR)
        )
    ]
    print("opened", flush=True)
    child = os.fork()
    if not child:
        for i, stream in enumerate(streams):
            os.dup2(stream, i)
            os.close(stream)
        os.chdir(order["folder"])
        sys.argv = ["-c", *order["arguments"]]
        # As Python makes them at its start.
        sys.stdin, sys.stdout = open(0), open(1, "w", closefd=False)
        sys.stderr = open(2, "w", buffering=1, errors="backslashreplace", closefd=False)
        exec(order["program"], {"__name__": "__main__"})
        sys.exit()
    for stream in streams:
        os.close(stream)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


def shown_on(terminal: int, until: bytes = b"") -> bytes:
    """Return the output of a terminal until `until` has appeared, or until the other side is closed."""
    output, deadline = b"", time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        try:
            piece = os.read(terminal, 65536)
        except OSError:  # on Linux: the other side is closed
            break
        output += piece
        if not piece or (until and until in output):
            break
    return output


@dataclass(frozen=True)
class Forks:
    """The process that forks the programs."""

    process: "subprocess.Popen[str]"

    def run(self, folder: Path, out: Path, program: str, *arguments: str) -> tuple[int, str, bytes]:
        """Run a program in `folder` with stdout in `out`; return exit code, stdout and terminal output."""
        terminal, program_side = os.openpty()
        order = {
            "folder": str(folder),
            "program": program,
            "arguments": arguments,
            "out": str(out),
            "err": os.ttyname(program_side),
        }
        assert self.process.stdin is not None
        self.process.stdin.write(f"{json.dumps(order)}\n")
        self.process.stdin.flush()
        assert self._line() == "opened"
        os.close(program_side)
        terminal_output = shown_on(terminal)
        code = int(self._line())
        os.close(terminal)
        return code, out.read_text(encoding="utf-8"), terminal_output

    def _line(self) -> str:
        assert self.process.stdout is not None
        return self.process.stdout.readline().strip()


@contextmanager
def forks(environment: Mapping[str, str]) -> Iterator[Forks]:
    """Yield a process that forks programs with this environment; it ends with the block."""
    with subprocess.Popen(  # noqa: S603 - the arguments are this file's
        [sys.executable, "-W", "ignore", "-c", FORKS],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
    ) as process:
        yield Forks(process)
        process.kill()
