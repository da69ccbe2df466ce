"""`python -m tests.server.load`: response times of pages under concurrent readers and uploads.

A reader opens pages of a synthetic fleet one after the other, with a pause of `--pause` seconds; an uploader
sends a recording, waits until it is diagnosed, and sends the next. Readers, uploaders, server and workers
share this machine.
"""

import argparse
import os
import random
import statistics
import sys
import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from .flights import as_csv, flight
from .made_up import fill
from .process import Server, over, serving

SORTS = ("urgency", "unit", "part", "rul", "hours", "health", "last", "explained")

ORDERS = (("desc", ""), ("asc", "SN-"), ("desc", "SN-"))
"""Orders, and filters that select all units: each combination gives a different page."""


@dataclass
class Times:
    """Response times of pages [s] by kind, answers with an error, upload times [s] and memory."""

    seconds: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    bad: list[tuple[str, int]] = field(default_factory=list)
    uploads: list[float] = field(default_factory=list)
    memory_MiB: list[float] = field(default_factory=list)


def paths(units: int, each: int, dice: random.Random) -> dict[str, str]:
    """Return the path of a random page of each kind."""
    return {
        "fleet": f"/?sort={dice.choice(SORTS)}&order={dice.choice(('asc', 'desc'))}",
        "fleet, filtered": f"/?search={dice.randrange(units):04d}&advice=fly+on",
        "unit": f"/units/{dice.randrange(units) + 1}",
        "diagnosis": f"/diagnoses/{dice.randrange(units * each) + 1}",
        "data health": "/data",
        "API, units": "/api/v1/units?limit=100",
        "API, curves": f"/api/v1/units/{dice.randrange(units) + 1}/curves",
    }


def read(
    server: Server, times: Times, stop: threading.Event, seed: int, arguments: argparse.Namespace
) -> None:
    """Open random pages until `stop`."""
    dice = random.Random(seed)
    connection = server.connection()
    stop.wait(dice.random() * arguments.pause)
    while not stop.is_set():
        kind, path = dice.choice(list(paths(arguments.units, arguments.each, dice).items()))
        start = time.perf_counter()
        try:
            connection.request("GET", path)
            answer = connection.getresponse()
            answer.read()
            status = answer.status
        except OSError:
            connection.close()
            status = 0
        times.seconds[kind].append(time.perf_counter() - start)
        if status != 200:
            times.bad.append((path, status))
        stop.wait(arguments.pause)
    connection.close()


def upload(server: Server, times: Times, stop: threading.Event, number: int) -> None:
    """Send recordings until `stop`."""
    table, sent = flight(), 0
    while not stop.is_set():
        content = as_csv(table, 1000 * (number + 1) + sent)
        fields = {"unit": f"UP-{number}", "hours": str(10 * sent), "actuator": "thesis"}
        start = time.perf_counter()
        status, answer = server.send(f"{sent}.csv", content, fields)
        if status != 202:
            times.bad.append(("upload", status))
            stop.wait(1.0)
            continue
        job = over(server, answer["id"])
        if job["state"] != "done":
            times.bad.append((f"upload: {job['message']}", 0))
        times.uploads.append(time.perf_counter() - start)
        sent += 1


def watch(server: Server, times: Times, stop: threading.Event) -> None:
    """Record the server's memory until `stop`."""
    while not stop.wait(2.0):
        times.memory_MiB.append(server.memory())


def timed(server: Server, paths: Sequence[str]) -> tuple[float, float]:
    """Return the median response time of pages and the server's mean processor time per page [ms]."""
    times_s, before = [], server.processor_seconds()
    for path in paths:
        start = time.perf_counter()
        server.get(path)
        times_s.append(time.perf_counter() - start)
    return 1e3 * statistics.median(times_s), 1e3 * (server.processor_seconds() - before) / len(paths)


def print_unloaded_times(server: Server) -> None:
    """Print the times of the fleet page without load: the first, newly rendered pages, and a cached page."""
    first, _ = timed(server, ["/"])
    queries = [f"/?sort={sort}&order={order}&search={search}" for sort in SORTS for order, search in ORDERS]
    made, made_processor = timed(server, queries)
    kept, kept_processor = timed(server, queries[-1:] * len(queries))
    print(f"first {first:.0f} ms; made {made:.0f} ms, of the processor {made_processor:.0f} ms; ", end="")
    print(f"kept {kept:.0f} ms, of the processor {kept_processor:.0f} ms")


def line(name: str, seconds: list[float]) -> str:
    """Return a table row of response times: count, median, 95th percentile and maximum [ms]."""
    ordered = sorted(seconds)
    p50, p95 = statistics.median(ordered), ordered[int(0.95 * (len(ordered) - 1))]
    return f"{name:17} {len(ordered):6} {1e3 * p50:8.0f} {1e3 * p95:8.0f} {1e3 * ordered[-1]:8.0f}"


def main() -> int:
    """Print a table row for each kind of page."""
    parser = argparse.ArgumentParser(prog="python -m tests.server.load", description=__doc__)
    parser.add_argument("--units", type=int, default=1000)
    parser.add_argument("--each", type=int, default=10, help="recordings of each unit")
    parser.add_argument("--readers", type=int, default=50)
    parser.add_argument("--uploaders", type=int, default=4)
    parser.add_argument("--seconds", type=float, default=300.0)
    parser.add_argument("--pause", type=float, default=1.0, help="that a reader looks at a page [s]")
    arguments = parser.parse_args()
    times, stop = Times(), threading.Event()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "fleet.sqlite"
        fill(file, arguments.units, arguments.each)
        with serving(file) as server:
            print(f"page of the fleet of {arguments.units} units, nothing else going on:")
            print_unloaded_times(server)
            threads = [
                threading.Thread(target=read, args=(server, times, stop, i, arguments))
                for i in range(arguments.readers)
            ]
            threads += [
                threading.Thread(target=upload, args=(server, times, stop, i))
                for i in range(arguments.uploaders)
            ]
            threads.append(threading.Thread(target=watch, args=(server, times, stop)))
            before = server.processor_seconds()
            for thread in threads:
                thread.start()
            time.sleep(arguments.seconds)
            stop.set()
            for thread in threads:
                thread.join()
            server_s = server.processor_seconds() - before
    print(f"{arguments.readers} readers, {arguments.uploaders} uploaders, {arguments.seconds:g} s:")
    print(f"{'page':17} {'opened':>6} {'p50 ms':>8} {'p95 ms':>8} {'most ms':>8}")
    for name, seconds in times.seconds.items():
        print(line(name, seconds))
    print(line("all pages", [page_s for of_kind in times.seconds.values() for page_s in of_kind]))
    count = sum(map(len, times.seconds.values()))
    print(f"processor time of the server: {server_s:.1f} s, {1e3 * server_s / max(count, 1):.1f} ms a page")
    print(f"load average of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    if times.uploads:
        print(f"uploads diagnosed: {len(times.uploads)}, median {statistics.median(times.uploads):.1f} s")
    print(f"memory of the server and its processes: {max(times.memory_MiB, default=0):.0f} MiB at most")
    print(f"answers that were no page: {len(times.bad)} {sorted(set(times.bad))[:5] if times.bad else ''}")
    return 1 if times.bad else 0


if __name__ == "__main__":
    sys.exit(main())
