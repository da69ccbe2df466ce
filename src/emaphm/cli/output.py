"""Output of the verbs: text or JSON on stdout, progress on stderr, figures in files."""

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
"""Reasons why stdout cannot be written that are no defect of the program, by error number."""

_lost: list[OSError] = []


def show(values: dict[str, Any], text: str, as_json: bool) -> None:
    """Print the answer, as JSON or as text.

    If the reader of a pipe has left (`emaphm … | head`) or the disk is full, nothing is printed and the verb
    continues: it still has to write the requested files and to report failures.
    """
    _print(_json(values) if as_json else text)


def show_line(values: "Mapping[str, Any]") -> bool:
    """Print one of several objects as a line of JSON, without buffering: a pipe's reader gets it at once.

    Returns
    -------
    Whether it was printed: False if the pipe has no reader or the disk is full.
    """
    return _print(_json(values), flush=True)


def show_at_once(text: str) -> bool:
    """Print a line without buffering, while the verb continues; return whether it was printed."""
    return _print(text, flush=True)


def _print(text: str, *, flush: bool = False) -> bool:
    try:
        print(text, flush=flush)
    except OSError as error:
        lose_stdout(error)
        return False
    return True


def lose_stdout(error: OSError) -> None:
    """Record for `reason_lost` why stdout cannot be written, and drop all later output.

    A pipe without a reader is not recorded, because it is no failure.
    """
    if not isinstance(error, BrokenPipeError):
        _lost.append(error)
    discard_stdout()


def reason_lost() -> str | None:
    """Return why stdout could not be written since the last call, None if it could."""
    first = next(iter(_lost), None)
    _lost.clear()
    return None if first is None else UNWRITABLE.get(first.errno or 0, first.strerror)


def discard_stdout() -> None:
    """Discard the buffered output; otherwise the interpreter would fail to write it when it exits."""
    _discard(sys.stdout)


def say(line: str) -> None:
    """Print a line for people on stderr, with the command's name; ignore a stderr without reader."""
    say_plainly(f"emaphm: {line}")


def say_plainly(text: str, end: str = "\n") -> None:
    """Print a text for people on stderr, without the command's name; ignore a stderr without reader."""
    try:
        print(text, end=end, file=sys.stderr, flush=True)
    except OSError:  # no reader (`2>&1 | true`); the exit code and the files remain
        _discard(sys.stderr)


def _discard(stream: TextIO) -> None:
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _json(values: "Mapping[str, Any]") -> str:
    return json.dumps(finite(values), allow_nan=False)


def draw(result: Any, figure: Path | None) -> None:
    """Save the figure of a result in the file `figure`, if it is given."""
    from emaphm.output_files import written_whole

    if figure is not None:
        from emaphm.plotting.svg import missing_glyphs_as_boxes

        with written_whole(figure) as temporary, missing_glyphs_as_boxes():
            result.plot().savefig(temporary, format=figure.suffix[1:].lower(), dpi=150)


@contextmanager
def progress(label: str, quiet: bool) -> "Iterator[Callable[[float], None] | None]":
    """Show a progress bar on stderr while the body runs, if stderr is a terminal and not `quiet`.

    Yields
    ------
    A function of the finished share (0 to 1), or None without a bar.
    """
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(label, total=1.0)

        def advance(fraction: float) -> None:
            raise_again()
            bar.update(task, completed=fraction)

        yield advance


@contextmanager
def counter(label: str, quiet: bool) -> "Iterator[Callable[[int, int], None] | None]":
    """Show the finished tasks and the remaining time on stderr while the body runs, as `progress` does.

    Yields
    ------
    A function of the numbers of finished tasks and of all tasks, or None without a bar.
    """
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
    # Runs of different methods differ in duration: the speed is averaged over the last two minutes.
    with Progress(*columns, console=Console(stderr=True), speed_estimate_period=120) as bar:
        task = bar.add_task(label, total=None)

        def count(done: int, total: int) -> None:
            raise_again()
            bar.update(task, completed=done, total=total)

        yield count
