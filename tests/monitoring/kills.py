"""`python -m tests.monitoring.kills --files 10000 --kills 20`: kills a watcher again and again.

Files arrive while it runs, by renaming and in two halves; the diagnosis is a stand-in (`stand_in.py`), or
with `--real` the program's. Prints what it found; it ends with 1 if a file is lost or judged twice, an event
is missing, twice in the history, or was never sent.
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import sqlalchemy as sa

from emaphm.history import Event, History
from emaphm.history.storage.tables import DIAGNOSES, RECORDINGS, WATCHED_FILES

from . import stand_in
from .hooks import Received, webhook

UNITS = 20


@dataclass
class Arriving:
    """Files that are written by a thread, at an even rate."""

    folder: Path
    files: int
    seconds: float
    content: Callable[[int, int], str]
    written: int = 0
    thread: threading.Thread = field(init=False)

    def __post_init__(self) -> None:
        self.thread = threading.Thread(target=self._write, daemon=True)

    def _write(self) -> None:
        began = time.monotonic()
        for i in range(self.files):
            time.sleep(max(0.0, began + self.seconds * i / self.files - time.monotonic()))
            unit, number = i % UNITS, i // UNITS
            path, text = self.folder / stand_in.name(unit, number), self.content(unit, number)
            if i % 3:
                part = path.with_suffix(".part")
                part.write_text(text)
                part.rename(path)
            elif i % 300:
                path.write_text(text)
            else:
                with path.open("w") as file:
                    file.write(text[: len(text) // 2])
                    file.flush()
                    time.sleep(0.1)
                    file.write(text[len(text) // 2 :])
            self.written = i + 1


def memory_mb(pid: int) -> float:
    """Return the resident memory of a process and of those that it has started [MB]."""
    total = 0.0
    with suppress(OSError):
        for line in Path(f"/proc/{pid}/status").read_text().splitlines():
            if line.startswith("VmRSS"):
                total += int(line.split()[1]) / 1024
        for children in Path(f"/proc/{pid}/task").glob("*/children"):
            total += sum(memory_mb(int(child)) for child in children.read_text().split())
    return total


@contextmanager
def watcher(
    folder: Path, where: str, lines: Path, hook: str, *more: str
) -> Iterator["subprocess.Popen[bytes]"]:
    """Yield a process that watches, killed with the block."""
    root = Path(__file__).resolve().parents[2]
    path = os.pathsep.join([str(root / "src"), str(root), os.environ.get("PYTHONPATH", "")])
    with (
        lines.open("ab") as out,
        subprocess.Popen(
            [sys.executable, "-W", "ignore", "-m", "tests.monitoring.stand_in", str(folder), where, *more],
            stdout=out,
            env={**os.environ, "PYTHONPATH": path, "WEBHOOK": hook},
        ) as process,
    ):
        try:
            yield process
        finally:
            process.send_signal(signal.SIGKILL)


def judged(where: str) -> int:
    """Return how many recordings a history holds."""
    if not Path(where).exists():
        return 0
    try:
        with History.open(where) as history, history.database.reading() as connection:
            return int(connection.execute(sa.select(sa.func.count()).select_from(RECORDINGS)).scalar_one())
    except ValueError:
        return 0  # not made yet


def check(where: str, files: int, sent: list[dict[str, object]], hook: Received) -> list[str]:
    """Return what is wrong with a history after all files have been judged."""
    wrong = []
    with History.open(where) as history:
        with history.database.reading() as connection:
            count = [
                connection.execute(sa.select(sa.func.count()).select_from(table)).scalar_one()
                for table in (RECORDINGS, DIAGNOSES, WATCHED_FILES)
            ]
        names = Counter(
            (unit.serial_number, one.hours) for unit in history.units() for one in unit.diagnoses()
        )
        events = history.events()
    if count != [files] * 3:
        wrong.append(f"{count} recordings, diagnoses, files done with; {files} arrived")
    expected = {(f"U{i % UNITS:02}", float(f"{i // UNITS * stand_in.FLIGHT_H:.2f}")) for i in range(files)}
    if set(names) != expected or max(names.values()) > 1:
        wrong.append("recordings are not where they were put")
    keys = [one.key for one in events]
    if len(set(keys)) < len(keys):
        wrong.append("an event is in the history twice")
    for whose, ids in (
        ("line", {one["id"] for one in sent}),
        ("webhook", {one["id"] for one in hook.events}),
    ):
        if set(keys) - ids:
            wrong.append(f"{len(set(keys) - ids)} of {len(keys)} events were not sent as {whose}")
        if ids - set(keys):
            wrong.append(f"{len(ids - set(keys))} events were sent as {whose} that are not in the history")
    return wrong


def conditions(events: tuple[Event, ...]) -> Counter[tuple[object, ...]]:
    """Return the events on units without what depends on when they were made."""
    return Counter(
        (one.kind, one.state, one.unit, one.hours, one.subject) for one in events if one.unit is not None
    )


def main() -> int:
    """Run; return 1 if anything is wrong."""
    parser = argparse.ArgumentParser(prog="python -m tests.monitoring.kills", description=__doc__)
    parser.add_argument("--files", type=int, default=10_000)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=240.0, help="in which the files arrive")
    parser.add_argument("--real", action="store_true", help="diagnose simulated recordings")
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    dice, wrong = random.Random(asked.seed), list[str]()
    with tempfile.TemporaryDirectory() as home, webhook() as hook:
        folder, where, lines = Path(home) / "in", f"{home}/history.sqlite", Path(home) / "lines"
        folder.mkdir()
        more = ("--real",) if asked.real else ()
        content = stand_in.simulated if asked.real else stand_in.content
        arriving = Arriving(folder, asked.files, asked.seconds, content)
        arriving.thread.start()
        began, halfway = time.monotonic(), 0
        for kill in range(asked.kills):
            before = judged(where)
            aim = max(before + 1, asked.files * kill // (asked.kills + 1))
            with watcher(folder, where, lines, hook.url, *more) as process:
                while judged(where) < aim and process.poll() is None:
                    time.sleep(0.05)
                time.sleep(dice.uniform(0.0, 0.5))
                halfway += judged(where) < asked.files
        arriving.thread.join()
        memory: list[float] = []
        with watcher(folder, where, lines, hook.url, "--once", *more) as process:
            while process.poll() is None:
                memory.append(memory_mb(process.pid))
                time.sleep(0.2)
            if process.returncode:
                wrong.append(f"the last watcher ended with {process.returncode}")
        took = time.monotonic() - began
        sent = [json.loads(line) for line in lines.read_bytes().split(b"\n") if line.endswith(b"}")]
        wrong += check(where, asked.files, sent, hook)
        undisturbed = f"{home}/undisturbed.sqlite"
        series: list[tuple[int, float]] = []
        with watcher(folder, undisturbed, Path(home) / "other", hook.url, "--once", *more) as process:
            while process.poll() is None:
                series.append((judged(undisturbed), memory_mb(process.pid)))
                time.sleep(1.0)
        with History.open(where) as one, History.open(undisturbed) as other:
            events, plain = one.events(), other.events()
        if conditions(events) != conditions(plain):
            differing = conditions(events) - conditions(plain) + (conditions(plain) - conditions(events))
            wrong.append(f"events differ from those of a watcher that nobody killed: {differing}")
    _say(asked.files, events, sent, series)
    print(f"{asked.kills} kills, {halfway} of them before all was judged; {took:.0f} s in all")
    print(
        "\n".join(wrong) or "nothing lost, nothing judged twice, the events are those of a run without kills"
    )
    return bool(wrong)


def _say(
    files: int, events: tuple[Event, ...], sent: list[dict[str, object]], series: list[tuple[int, float]]
) -> None:
    kinds = Counter(f"{one.kind} {one.state}" for one in events)
    counts = ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items()))
    print(f"{files} files; {len(events)} events: {counts}")
    print(f"sent again after a kill: {len(sent) - len({one['id'] for one in sent})} lines")
    for share in (0.1, 0.25, 0.5, 0.75, 1.0):
        at = [rss for count, rss in series if 0 < count <= share * files]
        if at:
            print(f"undisturbed, memory up to {share * files:.0f} files: {max(at):.0f} MB at most")


if __name__ == "__main__":
    sys.exit(main())
