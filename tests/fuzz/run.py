"""Running of cases, and complaints about wrong endings."""

import contextlib
import io
import json
import os
import shutil
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from random import Random

import numpy as np

from emaphm.actuator import Actuator
from emaphm.cli import main
from emaphm.errors import EmaphmError
from emaphm.recording import read_recording

from .classes import CLASSES, THESIS, Case, columns, good

SLOW_S = 30.0
"""A case that takes longer is a complaint, because some work has no limit."""


@dataclass
class Report:
    """Number of cases by class and exit code, and the complaints (class, case, message)."""

    counts: Counter[tuple[str, int]] = field(default_factory=Counter)
    complaints: list[tuple[str, Case, str]] = field(default_factory=list)

    def __str__(self) -> str:
        """Return a table with the number of completed, refused and faulty cases of each class."""
        wrong = Counter(name for name, _, _ in self.complaints)
        lines = [f"{'class':<20}{'done':>8}{'refused':>9}{'wrong':>7}"]
        for name in CLASSES:
            done, refused = self.counts[name, 0], self.counts[name, 2]
            lines.append(f"{name:<20}{done:>8}{refused:>9}{wrong[name]:>7}")
        lines.append(f"{sum(self.counts.values())} cases, {len(self.complaints)} complaints")
        return "\n".join(lines)


def fuzz(
    seed: int, *, cases: int | None = None, seconds: float | None = None, names: Sequence[str] = ()
) -> Report:
    """Run cases of the classes `names` (all if empty) up to a number of cases or a time limit."""
    random, report, start = Random(seed), Report(), time.monotonic()
    chosen = [name for name in CLASSES if not names or name in names]
    weights = [CLASSES[name][1] for name in chosen]
    with tempfile.TemporaryDirectory(prefix="emaphm-fuzz-") as folder:
        while (cases is None or sum(report.counts.values()) < cases) and (
            seconds is None or time.monotonic() - start < seconds
        ):
            name = random.choices(chosen, weights)[0]
            case = CLASSES[name][0](random)
            code, complaint = run(case, Path(folder) / "desk")
            report.counts[name, code] += 1
            if complaint:
                report.complaints.append((name, case, complaint))
    return report


def run(case: Case, folder: Path) -> tuple[int, str | None]:
    """Run a case in a new folder; return its exit code (1 if it raised) and its complaint or none."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    files = {"good.csv": good("csv"), "good.toml": THESIS.encode()} | case.files
    for name, content in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(content)
    out, err = io.StringIO(), io.StringIO()
    start = time.monotonic()
    with contextlib.chdir(folder), warnings.catch_warnings(record=True) as warned, _native_stderr() as native:
        warnings.simplefilter("always")
        try:
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                code = main(list(case.arguments))
        except KeyboardInterrupt:
            raise
        except BaseException:  # noqa: BLE001 - a panic of polars is not an Exception
            return 1, traceback.format_exc()
        seconds = time.monotonic() - start
        complaint = _complaint(case, code, out.getvalue(), err.getvalue() + native()) or _not_prefix(
            case, code
        )
    if warned:
        return code, f"warns: {warned[0].message} ({warned[0].filename}:{warned[0].lineno})"
    if seconds > SLOW_S:
        return code, f"takes {seconds:.0f} s"
    return code, complaint


def _complaint(case: Case, code: int, out: str, err: str) -> str | None:
    if code == 2:
        lines = err.splitlines()
        if out or len(lines) != 1 or not lines[0].startswith("emaphm: ") or len(lines[0]) > 2000:
            return f"is refused with {out[:500]!r} and {err[:3000]!r}"
        return None
    if code or err:
        return f"ends with {code} and {err[:3000]!r}"
    if "--json" in case.arguments:
        try:
            json.loads(out, parse_constant=_no_constant)
        except ValueError as error:
            return f"gives no JSON: {error}: {out[:500]!r}"
    return None


def _no_constant(name: str) -> None:
    raise ValueError(f"{name} is no JSON")


def _not_prefix(case: Case, code: int) -> str | None:
    """Return a complaint if the values read from a truncated file differ from the complete file."""
    if code or not case.prefix:
        return None
    try:
        recording = read_recording(next(iter(case.files)), Actuator.thesis())
    except EmaphmError as error:
        return f"is read by the command, not by the library: {error}"
    for name, values in columns().items():
        if name in recording and not np.array_equal(recording[name], values[: recording.samples]):
            return f"{name} is read otherwise than it stood there"
    return None


@contextlib.contextmanager
def _native_stderr() -> Iterator[Callable[[], str]]:
    """Capture the output of libraries to the stderr of the process."""
    saved = os.dup(2)
    with tempfile.TemporaryFile() as file:
        os.dup2(file.fileno(), 2)

        def written() -> str:
            sys.stderr.flush()
            file.seek(0)
            return file.read().decode(errors="replace")

        try:
            yield written
        finally:
            os.dup2(saved, 2)
            os.close(saved)
