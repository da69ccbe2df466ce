"""Synthetic fleet of units with prognoses; the friction of each unit rises at a different rate."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from emaphm.actuator import NAMES, Actuator, Faults
from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.diagnosis import Diagnosis, Estimate
from emaphm.history import Entry, Event, Finding, History, KeptSettings, Removal
from emaphm.history.basis import bases
from emaphm.history.fingerprint import description_of
from emaphm.history.kept_prognosis import KeptPrognosis, keep_prognosis
from emaphm.history.reading import unit as unit_row
from emaphm.history.storage.tables import UNITS
from emaphm.history.writing import add_diagnosis
from emaphm.prognosis import Evidence, Observation, prognose
from emaphm.prognosis.keeping import Curves
from emaphm.prognosis.settings import ForecastSettings
from emaphm.recording import Recording
from emaphm.recording.content import recording_hash
from emaphm.version import VERSION

THESIS = Actuator.thesis()

ACTIONS = ("fly on", "fly on", "fly on", "inspect by", "replace before")

STEP_H = 50.0
"""Hours between two recordings of a unit."""

ERROR = 0.01
"""Standard error of a level."""

UNEXPLAINED = ("the residual is three times as large as switching and noise allow",)


def recording(number: int) -> Recording:
    """Return a recording of 0.2 s at 1 kHz that is unique to its number."""
    time = np.arange(200) / 1e3
    swing = 2 * np.pi * 10.0 * time
    channels = {
        "time_s": time,
        "command_rad": 5e-3 * np.sin(swing),
        "current_A": 1.5 * np.sign(np.cos(swing)) + 1e-3 * number,
    }
    return Recording(channels, source=f"flight {number}.csv")


def diagnosis(held: Recording, friction: float, *, explained: bool = True) -> Diagnosis:
    """Return a diagnosis with this friction; the other components are healthy."""
    components = {
        name: Estimate(
            float(value),
            ERROR,
            (float(value) - 1.96 * ERROR, float(value) + 1.96 * ERROR),
            identifiable=True,
            verdict="cannot tell"
            if not explained
            else "degraded"
            if name == "friction" and value > 0.05
            else "healthy",
        )
        for name, value in zip(NAMES, Faults(friction=friction).vector, strict=True)
    }
    return Diagnosis(
        components=components,
        coordinates=CARTESIAN_NAMES,
        covariance=ERROR**2 * np.eye(len(CARTESIAN_NAMES)),
        method="hybrid",
        model="averaged",
        fitness_name="least_squares",
        fitness=0.01,
        residual_rms_A=0.05,
        explained=explained,
        evaluations=1000,
        reference_runs=30,
        seconds=0.3,
        seed=0,
        recording=held.source,
        actuator=THESIS,
        version=VERSION,
        time_s=held["time_s"],
        recorded=held["current_A"],
        modelled=held["current_A"],
        reasons=() if explained else UNEXPLAINED,
    )


def document_and_curves() -> tuple[dict[str, Any], dict[str, Any]]:
    """Return a prognosis for all units; `fill` changes only the numbers by which a page sorts."""
    observations = tuple(
        Observation(
            STEP_H * i,
            np.array([2e-4 * STEP_H * i, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5]),
            ERROR**2 * np.eye(8),
            np.ones(8, bool),
        )
        for i in range(1, 9)
    )
    few = ForecastSettings(paths=100, steps=40)
    prognosis = prognose(Evidence("made up", "EMA-0", 8 * STEP_H, observations), THESIS, settings=few)
    earlier = (
        (300.0, 500.0, 1500.0, 4000.0, 9000.0, 15000.0),
        (350.0, 450.0, 1400.0, 3900.0, 8000.0, 12000.0),
    )
    return prognosis.to_dict(), Curves.of(prognosis, earlier).to_dict()


def fill(file: str | Path, units: int, each: int = 3) -> None:
    """Create a history of `units` units with `each` recordings and a prognosis per unit."""
    document, curves = document_and_curves()
    with History.open(file, create=True) as history:
        for number in range(units):
            _fill_unit(history, number, each, json.loads(json.dumps(document)), curves)
        last = each * STEP_H + 10.0
        history.add_removal("SN-0002", Removal(last, "suspected", "slow to respond"))
        history.add_finding("SN-0002", Finding(last, "backlash", "degraded", 0.3, replaced=True))
        # Without a current prognosis, the server would compute one.
        kept = history.prognoses()["SN-0002"]
        current = KeptPrognosis.of(history.basis("SN-0002"), kept.document)
        with history.writing() as connection:
            keep_prognosis(connection, unit_row(connection, "SN-0002"), current, curves)
        history.add_events(
            Event("alarm", "raised", "alarm", "friction is degraded", "friction", "SN-0001", 100.0)
        )


def _fill_unit(
    history: History, number: int, each: int, document: dict[str, Any], curves: dict[str, Any]
) -> None:
    name, hours = f"SN-{number:04d}", STEP_H * each
    digest, toml = description_of(THESIS)
    with history.database.writing() as connection:
        for i in range(each):
            held = recording(number * each + i)
            result = diagnosis(held, 0.01 * (number % 40) * (i + 1) / each, explained=number % 11 != 5)
            position = None if i else f"aileron {number % 4}"
            entry = Entry(name, f"EMA-{number % 3}", STEP_H * (i + 1), position=position)
            settings = KeptSettings.of(result, digest)
            add_diagnosis(connection, entry, held, result, recording_hash(held), settings, toml)
        action, in_hours = ACTIONS[number % 5], float(13 * (number % 77))
        document["unit"], document["hours"] = name, hours
        document["advice"] |= {"action": action, "in_hours": in_hours, "at_hours": hours + in_hours}
        document["rul_hours"] = {"median": 3.0 * in_hours + 20.0, "interval90": [in_hours, None]}
        row = unit_row(connection, name)
        basis = bases(connection, UNITS.c.id == row.id)[row.id]
        keep_prognosis(connection, row, KeptPrognosis.of(basis, document), curves)
