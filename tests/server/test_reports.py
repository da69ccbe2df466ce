"""Reports and figures of uploads are stored with the diagnosis that they show."""

import re
from dataclasses import replace
from multiprocessing import Pipe
from pathlib import Path

import pytest

from emaphm.actuator import Actuator
from emaphm.errors import OutputError
from emaphm.history import Entry, History
from emaphm.recording import Recording, read_recording
from emaphm.server.folders import ServerFolder
from emaphm.server.run import running
from emaphm.server.work import worker
from emaphm.server.work.queue import DONE
from emaphm.server.work.worker import JobOutcome, Place, Upload
from monitoring import stand_in

from .conftest import SMALL, client_of

THESIS = Actuator.thesis()

FILES = ("report.html", "fit.svg", "residual.svg")


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace diagnosis and drawing by stand-ins."""

    def diagnosed(recording: Recording, actuator: Actuator, *, seed: int, **_: object) -> object:
        return stand_in.diagnosed(recording, actuator, seed=seed)

    monkeypatch.setattr("emaphm.diagnosis.diagnose", diagnosed)
    for name in ("draw_fit", "draw_residual"):
        monkeypatch.setattr(f"emaphm.plotting.diagnosis.{name}", lambda _: None)
    monkeypatch.setattr("emaphm.plotting.svg.svg", lambda _: b"<svg/>")
    monkeypatch.setattr("emaphm.report.write_report", lambda _, path, **__: path.write_text("<html>"))


def flight(folder: Path, number: int) -> Path:
    path = folder / stand_in.name(1, number)
    path.write_text(stand_in.content(1, number))
    return path


def uploaded(path: Path, db: Path, folder: ServerFolder) -> JobOutcome:
    """Return a worker's outcome for the recording at `path`, in a history that is created if missing."""
    with History.open(db, create=True):
        pass
    request = {"unit": "U01", "hours": 1.0, "part": "", "cycles": None, "position": None, "late": False}
    place = Place(str(db), folder, {THESIS.name: THESIS}, 2**33, 2**26)
    order = Upload(path, path.name, request | {"actuator": THESIS.name})
    return worker._outcome(order, place, Pipe()[1])


def statuses(db: Path, folder: ServerFolder) -> list[int]:
    """Return the status of each file of the first diagnosis, after a check that its page links them."""
    with running(str(db), None, folder.path, {}, replace(SMALL, workers=0)) as state:
        client = client_of(state)
        text = client.get("/diagnoses/1").text
        codes = [client.get(f"/diagnoses/1/{name}").status_code for name in FILES]
        assert [f"/diagnoses/1/{name}" in text for name in FILES] == [code == 200 for code in codes]
    return codes


def test_a_new_history_does_not_show_reports_of_the_previous_history(tmp_path: Path) -> None:
    folder, old, new = ServerFolder(tmp_path / "work"), tmp_path / "old.sqlite", tmp_path / "new.sqlite"
    with folder.locked():
        assert uploaded(flight(tmp_path, 1), old, folder).result["diagnosis"] == 1
    assert statuses(old, folder) == [200, 200, 200]

    recording = read_recording(flight(tmp_path, 2), THESIS)
    with History.open(new, create=True) as history:
        history.add(Entry("U01", "EMA", 1.0), recording, stand_in.diagnosed(recording, THESIS, seed=0))
    assert statuses(new, folder) == [404, 404, 404]
    assert statuses(old, folder) == [200, 200, 200]


def test_a_figure_is_cached_permanently_only_under_the_key_of_its_diagnosis(tmp_path: Path) -> None:
    folder, db = ServerFolder(tmp_path / "work"), tmp_path / "fleet.sqlite"
    with folder.locked():
        uploaded(flight(tmp_path, 1), db, folder)
    with running(str(db), None, folder.path, {}, replace(SMALL, workers=0)) as state:
        client = client_of(state)
        (shown,) = re.findall(r"/diagnoses/1/fit\.svg[^\"]*", client.get("/diagnoses/1").text)
        kept = [
            "immutable" in client.get(path).headers["cache-control"]
            for path in (shown, "/diagnoses/1/fit.svg", "/diagnoses/1/fit.svg?v=1")
        ]
    assert kept == [True, False, False]


@pytest.mark.parametrize("error", [OutputError("/srv/reports/1.html: No space left"), MemoryError()])
def test_an_upload_is_done_although_its_report_cannot_be_stored(
    error: Exception, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def full(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("emaphm.report.write_report", full)
    folder, db = ServerFolder(tmp_path / "work"), tmp_path / "fleet.sqlite"
    with folder.locked():
        outcome = uploaded(flight(tmp_path, 1), db, folder)
    assert (outcome.state, outcome.result["diagnosis"]) == (DONE, 1)
    assert outcome.message == "is in the history, but its report could not be kept"
    assert "no report of diagnosis 1" in caplog.text
    with History.open(db) as history:
        assert len(history.unit("U01").diagnoses()) == 1
