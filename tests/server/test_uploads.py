"""Uploads: refusals, storage, the order of jobs, and no loss of accepted uploads."""

import errno
import multiprocessing
import time
from multiprocessing import Pipe
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from emaphm.actuator import Actuator
from emaphm.errors import ServerError
from emaphm.server.run import running
from emaphm.server.work import worker
from emaphm.server.work.queue import AGAIN, DONE, FAILED, WAITING, Queue
from emaphm.server.work.worker import Place, Upload

from .conftest import SMALL, client_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from starlette.testclient import TestClient

    from emaphm.server.state import ServerState

CSV = b"time_s,command_rad\n0,0\n"
"""A recording without a current, which cannot be diagnosed."""

GOOD = {"unit": "SN-0001", "hours": "200"}


def sent(client: "TestClient", name: str = "a.csv", content: bytes = CSV, **fields: Any) -> Any:
    return client.post("/api/v1/recordings", files={"recording": (name, content)}, data={**GOOD, **fields})


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"unit": ""}, "is no name"),
        ({"unit": "a\x00b"}, "is no name"),
        ({"unit": "x" * 300}, "300 characters"),
        ({"hours": "many"}, "hours: give a number"),
        ({"hours": "nan"}, "hours: give a number"),
        ({"hours": "-1"}, "from 0 to 1,000,000"),
        ({"cycles": "1.5"}, "whole number"),
        ({"cycles": "99999999999"}, "whole number"),
        ({"actuator": "../../etc/passwd"}, "unknown description 'passwd'"),
        ({"late": "perhaps"}, "late: give true"),
        ({"x": "red"}, "unknown field 'x' (known: actuator, cycles, "),
        ({"Late": "true"}, "unknown field 'Late' (did you mean 'late'?)"),
    ],
)
def test_invalid_fields_are_refused(unchanged: "ServerState", fields: dict[str, str], reason: str) -> None:
    answer = sent(client_of(unchanged), "a.csv", CSV, **fields)
    assert answer.status_code == 422
    assert reason in answer.json()["detail"]
    assert not list(unchanged.folder.uploads.iterdir())


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"unit": "sn-0001"}, "no unit 'sn-0001' in the history (did you mean 'SN-0001'?)"),
        ({"unit": "SN-001"}, "choose a description to add a new unit"),
        ({"part": "EMA-7"}, "has the part number 'EMA-1', the diagnosis is of 'EMA-7'; check 'unit'"),
        ({"hours": "149"}, "150 h already, from a recording"),
        ({"hours": "149"}, "check 'hours', or give 'late'"),
        ({"unit": "SN-0002", "hours": "155"}, "160 h already, from a removal"),
    ],
)
def test_contradictions_to_the_history_are_refused_at_once(
    unchanged: "ServerState", fields: dict[str, str], reason: str
) -> None:
    answer = sent(client_of(unchanged), "a.csv", CSV, **fields)
    assert answer.status_code == 422
    assert reason in answer.json()["detail"]
    assert not list(unchanged.folder.uploads.iterdir())
    assert not unchanged.queue.jobs(1)


def test_a_refused_form_is_shown_again_with_its_values(state: "ServerState") -> None:
    client = client_of(state)
    fields = {"unit": "sn-0001", "hours": "<1250>", "position": "left", "actuator": "thesis", "late": "on"}
    answer = client.post("/upload", files={"recording": ("a.csv", CSV)}, data=fields)
    assert answer.status_code == 422
    assert "hours: give a number" in answer.text
    for kept in (
        'value="sn-0001"',
        'value="&lt;1250&gt;"',
        'value="left"',
        'thesis" selected',
        'late" checked',
    ):
        assert kept in answer.text
    sent(client)
    sent(client)
    sent(client)
    answer = client.post("/upload", files={"recording": ("a.csv", CSV)}, data=GOOD)
    assert answer.status_code == 503
    assert "3 uploads wait already" in answer.text


@pytest.mark.parametrize(
    "fields",
    [
        {"hours": "149", "late": "true"},
        {"hours": "100"},  # it may be the stored recording
        {"unit": "SN-9", "actuator": "thesis"},
        {"unit": "SN-9"},  # a unit that the upload before may add
    ],
)
def test_fields_that_may_be_valid_are_left_to_the_job(state: "ServerState", fields: dict[str, str]) -> None:
    if fields == {"unit": "SN-9"}:
        assert sent(client_of(state), "a.csv", CSV, actuator="thesis", **fields).status_code == 202
    assert sent(client_of(state), "a.csv", CSV, **fields).status_code == 202


def test_an_upload_is_accepted_while_the_history_is_unavailable(state: "ServerState", fleet: Path) -> None:
    state.history.close()
    away = fleet.rename(fleet.with_name("away.sqlite"))
    assert sent(client_of(state), unit="nobody").status_code == 202
    away.rename(fleet)


@pytest.mark.parametrize("name", ["a.exe", "a", ".csv", "a.csv.gz", "a.pkl"])
def test_files_with_other_extensions_are_refused(unchanged: "ServerState", name: str) -> None:
    assert sent(client_of(unchanged), name).status_code == 422


@pytest.mark.parametrize("name", ["../../x.csv", "/etc/x.csv", "..\\x.csv", "a\nb.csv", "é" * 300 + ".csv"])
def test_an_uploaded_file_name_is_never_used_as_a_path(
    state: "ServerState", name: str, tmp_path: Path
) -> None:
    before = {path for path in tmp_path.rglob("*") if path.parent != state.folder.uploads}
    answer = sent(client_of(state), name)
    assert answer.status_code == 202
    [kept] = state.folder.uploads.iterdir()
    assert kept.stem.isalnum()
    assert len(kept.name) == 36
    assert {path for path in tmp_path.rglob("*") if path.parent != state.folder.uploads} == before
    assert answer.json()["recording"].isprintable()
    assert not {"/", "\\"} & set(answer.json()["recording"])


def test_too_large_and_too_many_waiting_uploads_are_refused(state: "ServerState") -> None:
    client = client_of(state)
    assert sent(client, content=b"x" * 400_000).status_code == 413
    assert [sent(client).status_code for _ in range(4)] == [202, 202, 202, 503]
    answer = client.get("/api/v1/jobs?limit=2").json()
    assert ([job["id"] for job in answer["jobs"]], answer["total"]) == ([3, 2], 3)


def test_a_broken_form_is_refused(unchanged: "ServerState") -> None:
    client = client_of(unchanged)
    for kind in ("multipart/form-data", "multipart/form-data; boundary=x", "application/json", "text/plain"):
        answer = client.post("/api/v1/recordings", content=b"--y\r\n\r\n", headers={"content-type": kind})
        assert 400 <= answer.status_code < 500


@pytest.mark.parametrize(
    "fields",
    [{"files": {"file": ("a.csv", CSV)}, "data": GOOD}, {"data": {"recording": "a.csv"}}, {"json": GOOD}],
)
def test_a_file_in_another_field_is_refused(unchanged: "ServerState", fields: dict[str, Any]) -> None:
    answer = client_of(unchanged).post("/api/v1/recordings", **fields)
    assert answer.status_code == 422
    assert "as 'recording'" in answer.json()["detail"]


def test_a_repeated_field_is_refused(unchanged: "ServerState") -> None:
    answer = sent(client_of(unchanged), unit=["SN-0001", "SN-0002"])
    assert answer.status_code == 422
    assert answer.json()["detail"] == "unit: is given 2 times; give it once"


def test_an_accepted_upload_survives_a_killed_server(fleet: Path, state: "ServerState") -> None:
    number = sent(client_of(state)).json()["id"]
    assert state.queue.take() is not None  # a worker had it when the server was killed
    queue = Queue(state.folder.queue)
    assert queue.resume() == 1
    job = queue.job(number)
    assert job is not None
    assert job.state == WAITING
    assert state.folder.upload(job.file).read_bytes() == CSV
    with pytest.raises(ServerError, match="another server works"), running(str(fleet), None, None, {}, SMALL):
        pass


def test_uploads_of_one_unit_are_not_diagnosed_concurrently(state: "ServerState") -> None:
    first, second, other = (
        sent(client_of(state), unit=unit, hours=str(hours)).json()["id"]
        for unit, hours in (("SN-0001", 200), ("SN-0001", 201), ("SN-0002", 200))
    )
    taken = [state.queue.take() for _ in range(3)]
    assert [job and job.id for job in taken] == [first, other, None]
    state.queue.end(first, DONE, "", {})
    next_job = state.queue.take()
    assert next_job is not None
    assert next_job.id == second


def added(queue: Queue, *jobs: tuple[str, float]) -> None:
    for unit, hours in jobs:
        queue.add({"unit": unit, "hours": hours, "name": "a.csv"}, "a.csv")


def in_order(queue: Queue, quiet_s: float = 0.0) -> list[tuple[str, float]]:
    """Return unit and hours of the jobs that can be taken, each done before the next is taken."""
    taken = []
    while (job := queue.take(quiet_s)) is not None:
        queue.end(job.id, DONE, "", {})
        taken.append((job.request["unit"], job.request["hours"]))
    return taken


def test_jobs_of_a_unit_are_taken_in_the_order_of_hours(tmp_path: Path) -> None:
    queue = Queue(tmp_path / "queue.sqlite")
    added(queue, ("A", 30), ("A", 20), ("B", 9), ("A", 100), ("A", 20.5), ("B", 8))
    assert in_order(queue) == [("A", 20), ("A", 20.5), ("A", 30), ("B", 8), ("B", 9), ("A", 100)]
    queue.close()


def test_a_job_waits_while_more_uploads_of_its_unit_arrive(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 1000.0
    monkeypatch.setattr("time.monotonic", lambda: now)
    queue = Queue(tmp_path / "queue.sqlite")
    added(queue, ("A", 30))
    now += 1.5
    added(queue, ("A", 20), ("B", 5))
    now += 1.5
    added(queue, ("B", 4))
    assert in_order(queue, 2.0) == []
    now += 1.0
    assert in_order(queue, 2.0) == [("A", 20), ("A", 30)]
    now += 1.5
    assert in_order(queue, 2.0) == [("B", 4), ("B", 5)]
    for hours in range(61, 0, -1):  # uploads that do not end
        added(queue, ("A", hours))
        now += 1.0
    assert queue.take(2.0) is not None
    queue.close()


def test_jobs_of_an_ended_server_are_taken_without_waiting(tmp_path: Path) -> None:
    queue = Queue(tmp_path / "queue.sqlite")
    added(queue, ("A", 30), ("A", 20))
    assert in_order(queue, 1e9) == []
    queue.close()
    queue = Queue(tmp_path / "queue.sqlite")
    assert in_order(queue, 1e9) == [("A", 20), ("A", 30)]
    queue.close()


def test_an_upload_waits_while_the_history_is_unavailable(state: "ServerState", fleet: Path) -> None:
    sent(client_of(state))
    job = state.queue.take()
    assert job is not None
    place = Place(
        str(fleet.with_name("away.sqlite")), state.folder, {"thesis": Actuator.thesis()}, 2**33, 2**26
    )
    order = Upload(state.folder.upload(job.file), "a.csv", job.request)
    assert worker._outcome(order, place, Pipe()[1]).state == AGAIN
    state.queue.again(job.id)
    next_job = state.queue.take()
    assert next_job is not None
    assert (next_job.id, next_job.kills) == (job.id, 0)


def test_an_upload_that_cannot_be_queued_leaves_no_file(
    state: "ServerState", monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> int:
        raise ServerError("the disk of the queue is full")

    monkeypatch.setattr(state.queue, "add", full)
    assert sent(client_of(state)).status_code == 503
    assert not list(state.folder.uploads.iterdir())


@pytest.mark.parametrize("where", ["shutil.copyfileobj", "starlette.requests.Request.form"])
def test_an_upload_refused_by_a_full_disk_may_be_sent_again(
    state: "ServerState", monkeypatch: pytest.MonkeyPatch, where: str
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(where, full)
        answer = sent(client_of(state))
    assert answer.status_code == 503
    assert "cannot be kept (No space left on device)" in answer.json()["detail"]
    assert not list(state.folder.uploads.iterdir())
    assert sent(client_of(state)).status_code == 202


@pytest.fixture
def working(fleet: Path) -> "Iterator[ServerState]":
    """Yield the state of a server with a worker."""
    with running(str(fleet), None, None, {"thesis": Actuator.thesis()}, SMALL) as shared_state:
        yield shared_state


def test_a_killed_job_is_repeated_once(working: "ServerState") -> None:
    number = sent(client_of(working)).json()["id"]
    deadline = time.monotonic() + 60
    job = working.queue.job(number)
    while job is not None and not job.is_over and time.monotonic() < deadline:
        for process in multiprocessing.active_children():
            process.kill()
        time.sleep(0.01)
        job = working.queue.job(number)
    assert job is not None
    assert (job.state, job.kills) == (FAILED, 2)
    assert "killed twice" in job.message
    assert working.folder.upload(job.file).exists()
