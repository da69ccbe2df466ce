"""`python -m tests.monitoring.kills --files 10000 --kills 20`: a watcher that is killed repeatedly.

Files arrive while it runs, by renaming and in two halves; the diagnosis is a stand-in (`stand_in.py`), or
the real one with `--real`. Prints the result; the exit code is 1 if a file is lost or judged twice, or if an
event is missing, is twice in the history, or was never sent.
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
    """Files that a thread writes at a uniform rate."""

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
    """Return the resident memory of a process and its descendants [MB]."""
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
    """Yield a watcher process, which is killed with the block."""
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


def count_recordings(where: str) -> int:
    """Return the number of recordings in a history."""
    if not Path(where).exists():
        return 0
    try:
        with History.open(where) as history, history.database.reading() as connection:
            return int(connection.execute(sa.select(sa.func.count()).select_from(RECORDINGS)).scalar_one())
    except ValueError:
        return 0  # not created yet


def check(where: str, files: int, sent: list[dict[str, object]], hook: Received) -> list[str]:
    """Return the defects of a history after all files have been judged."""
    defects = []
    with History.open(where) as history:
        with history.database.reading() as connection:
            count = [
                connection.execute(sa.select(sa.func.count()).select_from(table)).scalar_one()
                for table in (RECORDINGS, DIAGNOSES, WATCHED_FILES)
            ]
        names = Counter(
            (unit.serial_number, event.hours) for unit in history.units() for event in unit.diagnoses()
        )
        events = history.events()
    if count != [files] * 3:
        defects.append(f"{count} recordings, diagnoses, files done with; {files} arrived")
    expected = {(f"U{i % UNITS:02}", float(f"{i // UNITS * stand_in.FLIGHT_H:.2f}")) for i in range(files)}
    if set(names) != expected or max(names.values()) > 1:
        defects.append("recordings are not where they were put")
    keys = [event.key for event in events]
    if len(set(keys)) < len(keys):
        defects.append("an event is in the history twice")
    for channel, ids in (
        ("line", {event["id"] for event in sent}),
        ("webhook", {event["id"] for event in hook.events}),
    ):
        if set(keys) - ids:
            defects.append(f"{len(set(keys) - ids)} of {len(keys)} events were not sent as {channel}")
        if ids - set(keys):
            defects.append(
                f"{len(ids - set(keys))} events were sent as {channel} that are not in the history"
            )
    return defects


def conditions(events: tuple[Event, ...]) -> Counter[tuple[object, ...]]:
    """Return the events of units without the fields that depend on their time."""
    return Counter(
        (event.kind, event.state, event.unit, event.hours, event.subject)
        for event in events
        if event.unit is not None
    )


def main() -> int:
    """Run the check and print the result."""
    parser = argparse.ArgumentParser(prog="python -m tests.monitoring.kills", description=__doc__)
    parser.add_argument("--files", type=int, default=10_000)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=240.0, help="in which the files arrive")
    parser.add_argument("--real", action="store_true", help="diagnose simulated recordings")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    random_numbers, defects = random.Random(arguments.seed), list[str]()
    with tempfile.TemporaryDirectory() as home, webhook() as hook:
        folder, where, lines = Path(home) / "in", f"{home}/history.sqlite", Path(home) / "lines"
        folder.mkdir()
        more = ("--real",) if arguments.real else ()
        content = stand_in.simulated if arguments.real else stand_in.content
        arriving = Arriving(folder, arguments.files, arguments.seconds, content)
        arriving.thread.start()
        start, halfway = time.monotonic(), 0
        for kill in range(arguments.kills):
            before = count_recordings(where)
            aim = max(before + 1, arguments.files * kill // (arguments.kills + 1))
            with watcher(folder, where, lines, hook.url, *more) as process:
                while count_recordings(where) < aim and process.poll() is None:
                    time.sleep(0.05)
                time.sleep(random_numbers.uniform(0.0, 0.5))
                halfway += count_recordings(where) < arguments.files
        arriving.thread.join()
        memory: list[float] = []
        with watcher(folder, where, lines, hook.url, "--once", *more) as process:
            while process.poll() is None:
                memory.append(memory_mb(process.pid))
                time.sleep(0.2)
            if process.returncode:
                defects.append(f"the last watcher ended with {process.returncode}")
        elapsed = time.monotonic() - start
        sent = [json.loads(line) for line in lines.read_bytes().split(b"\n") if line.endswith(b"}")]
        defects += check(where, arguments.files, sent, hook)
        undisturbed = f"{home}/undisturbed.sqlite"
        series: list[tuple[int, float]] = []
        with watcher(folder, undisturbed, Path(home) / "other", hook.url, "--once", *more) as process:
            while process.poll() is None:
                series.append((count_recordings(undisturbed), memory_mb(process.pid)))
                time.sleep(1.0)
        with History.open(where) as killed, History.open(undisturbed) as unkilled:
            events, undisturbed_events = killed.events(), unkilled.events()
        if conditions(events) != conditions(undisturbed_events):
            differing = (
                conditions(events)
                - conditions(undisturbed_events)
                + (conditions(undisturbed_events) - conditions(events))
            )
            defects.append(f"events differ from those of a watcher that nobody killed: {differing}")
    _print_summary(arguments.files, events, sent, series)
    print(f"{arguments.kills} kills, {halfway} of them before all was judged; {elapsed:.0f} s in all")
    print(
        "\n".join(defects)
        or "nothing lost, nothing judged twice, the events are those of a run without kills"
    )
    return bool(defects)


def _print_summary(
    files: int, events: tuple[Event, ...], sent: list[dict[str, object]], series: list[tuple[int, float]]
) -> None:
    kinds = Counter(f"{event.kind} {event.state}" for event in events)
    counts = ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items()))
    print(f"{files} files; {len(events)} events: {counts}")
    print(f"sent again after a kill: {len(sent) - len({event['id'] for event in sent})} lines")
    for share in (0.1, 0.25, 0.5, 0.75, 1.0):
        used = [rss for count, rss in series if 0 < count <= share * files]
        if used:
            print(f"undisturbed, memory up to {share * files:.0f} files: {max(used):.0f} MB at most")


if __name__ == "__main__":
    sys.exit(main())
