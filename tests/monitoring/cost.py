"""`python -m tests.monitoring.cost`: latency of events, throughput, memory and processor time of a watcher.

Latencies are of `emaphm watch` with real diagnoses of half a second at 5 kHz, each of which gives an event;
throughput and memory of a long stream are measured with a stand-in for the diagnosis.
"""

import argparse
import json
import math
import os
import queue
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

import emaphm as ema
from emaphm.history import History
from emaphm.monitoring import WATCH, Ownership, WatchTask, watch
from emaphm.monitoring.folder import FolderSource
from emaphm.monitoring.outlook import prognosed
from emaphm.monitoring.watch_state import WatchedFile, WatchState
from emaphm.prognosis import Evidence, Question, prognose
from emaphm.prognosis.evidence import Observation
from emaphm.recording import Recording, write_recording

from . import stand_in
from .kills import memory_mb
from .stand_in import THESIS

PATIENCE_S = 40.0

MOVES_S = 0.5

REST_S = 1.5


def command() -> ema.Sampled:
    """Return half a second of a chirp that fades out, followed by a rest."""
    time_s = np.arange(0.0, MOVES_S + REST_S, 1e-4)
    fading = np.clip((MOVES_S - time_s) / 0.1, 0.0, 1.0)
    return ema.Sampled(time_s, 5e-3 * fading * np.sin(2 * np.pi * 15 * time_s**2))


def recordings(count: int) -> list[Recording]:
    """Return recordings that alternate between no fault and a large friction."""
    return [
        ema.simulate(
            THESIS,
            command(),
            duration=MOVES_S + REST_S,
            faults=ema.Faults(friction=0.3 * (i % 2)),
            noise=0.05,
            seed=i,
        )
        for i in range(count)
    ]


@contextmanager
def watching(*line: str) -> Iterator[tuple["subprocess.Popen[str]", "queue.Queue[tuple[float, Any]]"]]:
    """Yield an `emaphm watch` process and a queue of its events with their times of arrival."""
    with subprocess.Popen(
        [sys.executable, "-W", "ignore", "-m", "emaphm.cli", "watch", *line],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as process:
        events: queue.Queue[tuple[float, Any]] = queue.Queue()

        def read() -> None:
            assert process.stdout is not None
            for text in process.stdout:
                events.put((time.monotonic(), json.loads(text)))

        threading.Thread(target=read, daemon=True).start()
        try:
            yield process, events
        finally:
            process.kill()


def change_at(events: "queue.Queue[tuple[float, Any]]", hours: float) -> float:
    """Return the time of arrival of the health event at these hours, or NaN without one in time."""
    while True:
        try:
            arrived, event = events.get(timeout=PATIENCE_S)
        except queue.Empty:
            return float("nan")
        if (event["event"], event["hours"]) == ("health_changed", hours):
            return arrived


def of_files(home: Path, count: int) -> None:
    """Print the latency from a file's last row to its event."""
    folder = home / "in"
    folder.mkdir()
    latencies = []
    with watching(
        str(folder), "--db", f"{home}/files.sqlite", "--name", "{unit}_{hours}.csv", "--new-units"
    ) as (_, events):
        for i, recording in enumerate(recordings(count + 2)):
            write_recording(recording, folder / f"U_{i}.csv")
            written = time.monotonic()
            if i > 0:  # the first recording is healthy and gives no event
                latencies.append(change_at(events, float(i)) - written)
    _print_latencies("a file, from its last row to its event", latencies[1:])


def of_rows(home: Path, count: int) -> None:
    """Print the latency from the last row of a movement to its event, for rows sent in real time."""
    latencies = []
    line = ("-", "--db", f"{home}/rows.sqlite", "--unit", "U", "--new-units")
    with watching(*line) as (process, events):
        assert process.stdin is not None
        for i, recording in enumerate(recordings(count + 2)):
            rows = _rows(recording, i)
            start = time.monotonic()
            for k in range(0, len(rows), 100):  # in real time
                time.sleep(max(0.0, start + k * recording.interval_s - time.monotonic()))
                process.stdin.writelines(rows[k : k + 100])
                process.stdin.flush()
            written = start + MOVES_S
            if i > 0:
                latencies.append(change_at(events, float(i)) - written)
    _print_latencies("a movement of a stream, from its last row to its event", latencies[1:])


def _rows(recording: Recording, flight: int) -> list[str]:
    names = ("time_s", "command_rad", "current_A", "voltage_V")
    columns = [recording[name].tolist() for name in names]
    return [
        json.dumps({"hours": float(flight), **dict(zip(names, row, strict=True))}) + "\n"
        for row in zip(*columns, strict=True)
    ]


def _print_latencies(subject: str, latencies: list[float]) -> None:
    valid = [latency for latency in latencies if not math.isnan(latency)]
    print(
        f"{subject}: median {np.median(valid):.1f} s, {min(valid):.1f} to {max(valid):.1f} s; "
        f"{len(valid)} of {len(latencies)} recordings made an event; load {os.getloadavg()[0]:.0f} on "
        f"{os.cpu_count()} cores",
        flush=True,
    )


def of_a_long_stream(home: Path, hours: float) -> None:
    """Print throughput [rows/s] and memory for a stream of `hours` at 100 Hz."""
    total, out, into = int(hours * 3600 * 100), *os.pipe()
    memory: list[tuple[float, float]] = []

    def write() -> None:
        with os.fdopen(into, "w") as pipe:
            pipe.write("time_s,command_rad,current_A\n")
            for first in range(0, total, 2000):
                time_s = np.arange(first, first + 2000) / 100
                command = np.where(time_s % 20 < 5, 5e-3 * np.sin(8 * np.pi * time_s), 0.0)
                current = 1e-9 * time_s
                pipe.writelines(
                    f"{t:.2f},{c:.6f},{i:.9f}\n"
                    for t, c, i in zip(time_s.tolist(), command.tolist(), current.tolist(), strict=True)
                )
                memory.append((first / total, memory_mb(os.getpid())))

    threading.Thread(target=write, daemon=True).start()
    start = time.monotonic()
    with History.open(home / "long.sqlite", create=True) as history:
        task = WatchTask(
            out,
            Ownership(THESIS.name, "U", 1.0),
            cut=None,
            diagnose=stand_in.diagnosed,
            takes_new_units=True,
        )
        result = watch(task, history, THESIS, settings=stand_in.QUICK)
    elapsed = time.monotonic() - start
    times = np.array([share for share, _ in memory])
    shares = [memory[int(np.argmin(np.abs(times - at)))][1] for at in (0.1, 0.5, 1.0)]
    print(
        f"a stream of {hours:g} h at 100 Hz: {result.judged} movements of {total} rows in {elapsed:.0f} s, "
        f"{total / elapsed:.0f} rows/s; memory at 10, 50 and 100 %: {shares[0]:.0f}, {shares[1]:.0f}, "
        f"{shares[2]:.0f} MB",
        flush=True,
    )


def of_a_full_folder(home: Path, files: int) -> None:
    """Print the time of one poll of a folder in which all files are judged."""
    folder = home / "full"
    folder.mkdir()
    with History.open(home / "full.sqlite", create=True) as history:
        state = WatchState(history, "full")
        for i in range(files):
            path = folder / f"U_{i}.csv"
            path.touch()
            status = path.stat()
            state.finish_file(WatchedFile(path.name, 0, status.st_mtime_ns, "", "judged"))
        source = FolderSource(folder, THESIS, Ownership(THESIS.name), state, WATCH.folder)
        start = time.monotonic()
        source.next()
        elapsed_ms = 1e3 * (time.monotonic() - start)
        print(f"a look at a folder of {files} judged files: {elapsed_ms:.0f} ms", flush=True)


def of_a_prognosis(home: Path, units: int) -> None:
    """Print processor times of `emaphm watch`'s prognoses for a fleet of `units` with 100 diagnoses each."""
    count = WATCH.prognosis.most
    with History.open(home / "fleet.sqlite", create=True) as history:
        for number in range(1, units + 1):
            rate = np.random.default_rng(number).uniform(5e-4, 3e-3)
            stand_in.fly(history, [0.02 + rate * i for i in range(count)], unit=f"S{number}")
        evidence = Evidence.of(history.unit("S1"))
        times = {
            "of a unit alone": cpu_s(lambda: prognose(evidence, THESIS, keep_past=False)),
            f"that learns from {units - 1} others, the first of a process": prognosis_s(history, "S1"),
            "the next of the same unit": prognosis_s(history, "S1"),
            "the first of another unit": prognosis_s(history, "S2"),
        }
        stand_in.fly(history, [0.1], first=20.0 * count, unit="S2")
        times["of a unit after a new diagnosis of another"] = prognosis_s(history, "S1")
    for subject, seconds in times.items():
        print(f"a prognosis {subject}: {seconds:.1f} s of processor", flush=True)


def prognosis_s(history: History, unit: str) -> float:
    """Return the processor time of a prognosis that is stored with its event and curves [s]."""
    return cpu_s(lambda: prognosed(history, unit, WATCH.prognosis))


def cpu_s(work: Callable[[], object]) -> float:
    """Return the processor time of this process for `work` [s]."""
    start = time.process_time()
    work()
    return time.process_time() - start


def of_healthy_units(units: int = 4) -> None:
    """Print the probability of failure of healthy units; values up to the risk raise no event."""
    settings, error = WATCH.prognosis, 0.012
    question, probabilities = Question(settings.horizon, settings.risk), []
    for unit in range(units):
        random = np.random.default_rng(unit)
        for hours in (2.0, 20.0):
            observations = tuple(
                Observation(
                    hours * (i + 1),
                    np.abs(error * random.standard_normal(8)) + np.append(np.zeros(7), 0.5),
                    error**2 * np.eye(8),
                    np.ones(8, bool),
                )
                for i in range(20)
            )
            for count in (settings.fewest, 10, 20):
                evidence = Evidence("U", THESIS.name, hours * count, observations[:count])
                prognosis = prognose(evidence, THESIS, question, keep_past=False)
                probabilities.append(prognosis.probability_of_failure)
    above = sum(probability > settings.risk for probability in probabilities)
    print(
        f"healthy units, a diagnosis each 2 or 20 h, {settings.fewest} to 20 of them: probability of failure "
        f"within {settings.horizon:g} h {min(probabilities):.3f} to {max(probabilities):.3f}, "
        f"{above} of {len(probabilities)} above {settings.risk:g}",
        flush=True,
    )


def main() -> int:
    """Print a line for each measurement."""
    parser = argparse.ArgumentParser(prog="python -m tests.monitoring.cost", description=__doc__)
    parser.add_argument("--recordings", type=int, default=8)
    parser.add_argument("--hours", type=float, default=2.0)
    parser.add_argument("--files", type=int, default=2000)
    parser.add_argument("--units", type=int, default=31, help="of the fleet that a prognosis learns from")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as home:
        of_a_prognosis(Path(home), arguments.units)
        of_healthy_units()
        of_files(Path(home), arguments.recordings)
        of_rows(Path(home), arguments.recordings)
        of_a_long_stream(Path(home), arguments.hours)
        of_a_full_folder(Path(home), arguments.files)
    return 0


if __name__ == "__main__":
    sys.exit(main())
