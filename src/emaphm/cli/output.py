"""How verbs answer: text or JSON on stdout, progress on stderr, figures in files."""

import errno
import json
import os
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from emaphm.cli.interruption import raise_again
from emaphm.strict_json import finite

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping


UNWRITABLE = {
    errno.ENOSPC: "no space is left for it",
    errno.EDQUOT: "the disk quota is used up",
    errno.EFBIG: "it would be larger than files may be",
    errno.EBADF: "it is not open for writing",
    errno.EIO: "the device fails",
}
"""What may happen to stdout, and is no defect of ours."""

_lost: list[OSError] = []


def show(values: dict[str, Any], text: str, as_json: bool) -> None:
    """Print the answer, as JSON or as text.

    Where the reader of a pipe has left (`emaphm … | head`) or stdout is full, nothing is printed and the verb
    goes on: the files that were asked for are still to be written, and what failed is still to be said.
    """
    _print(_json(values) if as_json else text)


def show_line(values: "Mapping[str, Any]") -> bool:
    """Print one object of many as a line of JSON, at once: whoever reads the pipe need not wait for all.

    Returns
    -------
    Whether it could be printed: somebody reads the pipe, and the disk is not full.
    """
    return _print(_json(values), flush=True)


def show_at_once(text: str) -> bool:
    """Print a line that somebody waits for while the verb goes on; return whether that could be."""
    return _print(text, flush=True)


def _print(text: str, *, flush: bool = False) -> bool:
    try:
        print(text, flush=flush)
    except OSError as error:
        lose_stdout(error)
        return False
    return True


def lose_stdout(error: OSError) -> None:
    """Remember why stdout cannot be written, for `reason_lost`, and drop what is printed from now on.

    A reader of a pipe that has left is no failure.
    """
    if not isinstance(error, BrokenPipeError):
        _lost.append(error)
    discard_stdout()


def reason_lost() -> str | None:
    """Return why stdout could not be written since this was asked last, None where it could."""
    first = next(iter(_lost), None)
    _lost.clear()
    return None if first is None else UNWRITABLE.get(first.errno or 0, first.strerror)


def discard_stdout() -> None:
    """Send what is still buffered nowhere, or the interpreter would fail on it when it exits."""
    _discard(sys.stdout)


def say(line: str) -> None:
    """Print a line for people on stderr, whether or not somebody reads it."""
    say_plainly(f"emaphm: {line}")


def say_plainly(text: str, end: str = "\n") -> None:
    """Print a text for people on stderr, without the command's name, whether or not somebody reads it."""
    try:
        print(text, end=end, file=sys.stderr, flush=True)
    except OSError:  # nobody reads it (`2>&1 | true`); the exit code and the files say enough
        _discard(sys.stderr)


def _discard(stream: TextIO) -> None:
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _json(values: "Mapping[str, Any]") -> str:
    return json.dumps(finite(values), allow_nan=False)


def draw(result: Any, figure: Path | None) -> None:
    """Save the figure of a result where one was asked for."""
    from emaphm.output_files import written_whole

    if figure is not None:
        with written_whole(figure) as temporary:
            result.plot().savefig(temporary, format=figure.suffix[1:].lower(), dpi=150)


@contextmanager
def progress(what: str, quiet: bool) -> "Iterator[Callable[[float], None] | None]":
    """Show a progress bar on stderr while the body runs, if a person is watching."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=1.0)

        def advance(fraction: float) -> None:
            raise_again()
            bar.update(task, completed=fraction)

        yield advance


@contextmanager
def counter(what: str, quiet: bool) -> "Iterator[Callable[[int, int], None] | None]":
    """Show runs done and the time left on stderr while the body runs, if a person is watching."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    # Runs of different methods differ in length: the estimate is taken from the last minute and more.
    with Progress(*columns, console=Console(stderr=True), speed_estimate_period=120) as bar:
        task = bar.add_task(what, total=None)

        def count(done: int, total: int) -> None:
            raise_again()
            bar.update(task, completed=done, total=total)

        yield count
