"""`python -m tests.monitoring.stand_in FOLDER DB`: a watcher with a stand-in for the diagnosis.

A real diagnosis takes half a second, which is too long for a test with 10,000 files. The stand-in estimates
friction from the recording's mean current; every other step, from reading the file to the events, is real.
With `--real`, the diagnosis is real too; with `--once`, the watcher ends when all files are judged.
"""

import os
import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np

from emaphm.actuator import NAMES, Actuator, Faults
from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.diagnosis import Diagnosis, Estimate
from emaphm.history import Entry, History
from emaphm.monitoring import WATCH, NamePattern, Ownership, WatchSettings, WatchTask, watch
from emaphm.monitoring.diagnosers import search
from emaphm.monitoring.settings import IsolationSettings
from emaphm.recording import Recording
from emaphm.version import VERSION

ROWS = 60
FLIGHT_H = 0.24
"""Hours between two recordings of a unit: 100 of them are 24 hours."""

QUICK = replace(
    WATCH,
    folder=replace(WATCH.folder, poll_s=0.2, settle_s=0.3),
    prognosis=replace(WATCH.prognosis, most=3),
    delivery=replace(WATCH.delivery, timeout_s=1.0, first_pause_s=0.05, longest_pause_s=0.5, last_s=20.0),
)


ROOMY = IsolationSettings(seconds=60.0)


def is_faulty(number: int) -> bool:
    """Return whether a unit's recording with this number has a fault; faults are single and in runs."""
    return number % 40 in {7, 20, 21, 22, 23, 24, 33, 34}


def content(unit: int, number: int) -> str:
    """Return the CSV of a unit's recording, which is unique."""
    time = np.arange(ROWS) / 1e3
    current = np.sign(np.cos(2 * np.pi * 40 * time)) + (0.5 if is_faulty(number) else 0.0)
    current += 1e-6 * (1000 * unit + number)
    rows = (
        f"{t:.4f},{5e-3 * np.sin(2 * np.pi * 40 * t):.6f},{i:.7f}" for t, i in zip(time, current, strict=True)
    )
    return "time_s,command_rad,current_A\n" + "\n".join(rows) + "\n"


def simulated(unit: int, number: int) -> str:
    """Return the CSV of a simulated recording, for real diagnoses."""
    from emaphm.actuator import Chirp
    from emaphm.simulated_recording import simulate

    faults = Faults(friction=0.3 if number else 0.0)  # three of four recordings have the fault: an alarm
    recording = simulate(THESIS, Chirp(), faults=faults, noise=0.05, seed=1000 * unit + number)
    return recording.to_frame().select("time_s", "command_rad", "current_A", "voltage_V").write_csv()


def name(unit: int, number: int) -> str:
    """Return the name of a recording's file."""
    return f"U{unit:02}_{number * FLIGHT_H:.2f}.csv"


THESIS = Actuator.thesis()
PATTERN = NamePattern.parse("{unit}_{hours}.csv")
COORDINATES = (*CARTESIAN_NAMES, "load")
ERROR = 0.01
"""Standard error of each component."""

FAULTY = 0.3
"""Friction above which the verdict is degraded; recordings have 0.1 without a fault and 0.6 with one."""


def diagnosis(recording: Recording, actuator: Actuator, friction: float, *, seed: int = 0) -> Diagnosis:
    """Return a diagnosis with this friction and no other fault; it is degraded above `FAULTY`."""
    vector = Faults(friction=friction).vector
    components = {
        name: Estimate(
            float(value),
            ERROR,
            (float(value) - 2 * ERROR, float(value) + 2 * ERROR),
            identifiable=True,
            verdict="degraded" if name == "friction" and friction > FAULTY else "healthy",
        )
        for name, value in zip(NAMES, vector, strict=True)
    }
    return Diagnosis(
        components=components,
        coordinates=COORDINATES,
        covariance=ERROR**2 * np.eye(len(COORDINATES)),
        method="hybrid",
        model="averaged",
        fitness_name="least_squares",
        fitness=0.01,
        residual_rms_A=0.05,
        explained=True,
        evaluations=0,
        reference_runs=0,
        seconds=0.0,
        seed=seed,
        recording=recording.source,
        actuator=actuator,
        version=VERSION,
        time_s=recording["time_s"],
        recorded=recording["current_A"],
        modelled=recording["current_A"],
    )


def diagnosed(recording: Recording, actuator: Actuator, *, seed: int) -> Diagnosis:
    """Return the stand-in diagnosis, whose friction is the clipped mean current."""
    return diagnosis(recording, actuator, float(np.mean(recording["current_A"]).clip(0.0, 1.0)), seed=seed)


def fly(
    history: History,
    friction: list[float],
    first: float = 0.0,
    unit: str = "S1",
    actuator: Actuator = THESIS,
) -> None:
    """Add diagnoses of a unit with these friction levels, at intervals of 20 h."""
    for i, level in enumerate(friction):
        hours = first + 20.0 * i
        columns = {name: np.arange(60.0) + hours for name in ("time_s", "command_rad")}
        columns["current_A"] = np.full(60, float(unit.strip("S")))  # no recording is of two units
        recording = Recording(columns, source=f"{hours:g}.csv")
        history.add(Entry(unit, THESIS.name, hours), recording, diagnosis(recording, actuator, level))


def run(
    folder: Path,
    where: str,
    *,
    lines: int | None = None,
    webhook: str | None = None,
    once: bool = False,
    real: bool = False,
    settings: WatchSettings = QUICK,
    stop: threading.Event | None = None,
) -> None:
    """Watch a folder with the stand-in or the real diagnosis."""
    with History.open(where, create=True) as history:
        task = WatchTask(
            folder,
            Ownership(THESIS.name, pattern=PATTERN),
            "test",
            cut=None,
            diagnose=search if real else diagnosed,
            takes_new_units=True,
            isolated=True,
            once=once,
            webhook=webhook,
            lines=lines,
        )
        watch(task, history, THESIS, settings=settings, stop=stop, say=_say)


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


if __name__ == "__main__":
    run(
        Path(sys.argv[1]),
        sys.argv[2],
        lines=1,
        webhook=os.environ.get("WEBHOOK"),
        once="--once" in sys.argv,
        real="--real" in sys.argv,
    )
