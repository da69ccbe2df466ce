"""A watcher with an estimator whose file is missing for some time."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from amortized.toys import CHIRP, THESIS, constant_estimator, short_setup
from emaphm.actuator import Faults
from emaphm.history import History
from emaphm.monitoring import Ownership, WatchTask, diagnosers, watch
from emaphm.monitoring.diagnosers import ByEstimator
from emaphm.recording import Recording, write_recording
from emaphm.simulated_recording import simulate

from .stand_in import PATTERN, QUICK, diagnosed

WRITTEN = replace(QUICK, folder=replace(QUICK.folder, poll_s=0.02, settle_s=0.02))


@pytest.mark.usefixtures("no_prognoses", "answers_taken")
def test_a_missing_estimator_and_its_return_are_reported_once_each(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(diagnosers, "search", diagnosed)  # the test checks the method, not the result
    folder, file = tmp_path / "in", tmp_path / "unit.estimator"
    folder.mkdir()
    truth, setup = Faults(friction=0.3), short_setup()
    constant_estimator(setup, setup.space.points(truth.vector), 0.02).save(file)
    for number in range(4):
        simulated = simulate(
            THESIS, CHIRP, faults=truth, duration=0.1, sample_rate=2000.0, noise=0.01, seed=number
        )
        columns = {name: simulated[name] for name in ("time_s", "command_rad", "current_A", "voltage_V")}
        write_recording(Recording(columns), folder / f"U_{number}.csv")
    away, messages = tmp_path / "away.estimator", list[str]()

    def move(done: int, _: int) -> None:
        if done == 1:
            file.rename(away)
        if done == 3:
            away.rename(file)

    task = WatchTask(
        folder,
        Ownership(THESIS.name, pattern=PATTERN),
        cut=None,
        diagnose=ByEstimator(str(file), fast=True),
        takes_new_units=True,
        once=True,
    )
    with History.open(tmp_path / "h.sqlite", create=True) as history:
        watch(task, history, THESIS, settings=WRITTEN, say=messages.append, on_count=move)
        kept = [json.loads(document.text) for document in history.unit("U").diagnoses()]
    assert [document["method"].startswith("estimator") for document in kept] == [True, False, False, True]
    assert len(messages) == 2, messages
    assert "unit.estimator: no such file" in messages[0]
    assert messages[0].endswith("meanwhile recordings are diagnosed by the full search")
    assert messages[1] == "the estimator can be used again"
