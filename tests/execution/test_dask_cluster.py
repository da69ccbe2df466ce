"""Tasks on a Dask scheduler: lost and added workers, and clusters that fail or do not exist."""

import asyncio
import json
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

from dask_processes import Cluster, Forks, with_tests
from emaphm.cli import main
from emaphm.errors import ExecutionError, StudyError
from emaphm.execution import ResultStore, dask_cluster, outcomes, run_tasks
from emaphm.execution.dask_cluster import run_on_cluster
from emaphm.study import Store, run_study
from emaphm.study import store as store_module
from study import small

from . import toy

pytestmark = pytest.mark.skipif(find_spec("distributed") is None, reason="Dask is not installed")

PATIENCE_S = 60
"""Time limit for the start of a process on a busy machine."""

TOTAL = 40
TASKS = toy.tasks(TOTAL, toy.square, 0.01)
"""Duration of the tasks, long enough to lose a worker during the run."""


@pytest.fixture(scope="module")
def cluster(forks: Forks, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """Return a cluster of two workers."""
    opened = Cluster(forks, tmp_path_factory.mktemp("cluster"))
    for _ in range(2):
        opened.add_worker()
    yield opened
    opened.close()


@pytest.fixture
def store(tmp_path: Path) -> ResultStore:
    return ResultStore(tmp_path / "results.sqlite")


def kept(store: ResultStore) -> list[object]:
    return toy.in_order(list(store.read(TASKS)[0].values()))


# Lost and added workers


def test_a_run_continues_when_a_worker_is_lost_and_another_added(
    cluster: Cluster, store: ResultStore, capfd: pytest.CaptureFixture[str]
) -> None:
    progress: list[tuple[int, int]] = []

    def replace_worker(done: int, total: int) -> None:
        progress.append((done, total))
        if done == 10:
            cluster.workers[0].kill()
            cluster.add_worker()

    assert run_tasks(TASKS, store, scheduler=cluster.address, on_task=replace_worker) == ()
    assert kept(store) == toy.results(TOTAL)
    assert progress == [(done, TOTAL) for done in range(TOTAL + 1)]
    assert capfd.readouterr() == ("", "")


def test_a_run_is_resumed_after_its_client_was_killed(cluster: Cluster, store: ResultStore) -> None:
    program = (
        "import sys; from pathlib import Path; from emaphm.execution import ResultStore, run_tasks;"
        "from execution import toy;"
        f"tasks = toy.tasks({TOTAL}, toy.square, 0.1);"
        "run_tasks(tasks, ResultStore(Path(sys.argv[1])), scheduler=sys.argv[2],"
        " on_task=lambda done, _: print(done, flush=True))"
    )
    with subprocess.Popen(  # noqa: S603 - the arguments are this file's
        [sys.executable, "-c", program, store.path, cluster.address],
        env=os.environ | with_tests(),
        stdout=subprocess.PIPE,
        text=True,
    ) as client:
        assert client.stdout is not None
        assert [int(client.stdout.readline()) for _ in range(3)] == [0, 1, 2]
        client.kill()
    assert 2 <= len(store.read(TASKS)[0]) < TOTAL
    assert run_tasks(TASKS, store, scheduler=cluster.address) == ()
    assert kept(store) == toy.results(TOTAL)


def test_results_of_two_simultaneous_callers_do_not_mix(cluster: Cluster) -> None:
    other_tasks = toy.tasks(12, toy.fail_on_seven)
    running = run_on_cluster(TASKS, cluster.address)
    first_outcomes = [next(running)]
    of_others = {outcome.index: outcome for outcome in run_on_cluster(other_tasks, cluster.address)}
    first_outcomes.extend(running)
    assert toy.in_order(first_outcomes) == toy.results(TOTAL)
    assert of_others.keys() == set(range(12))
    assert of_others[7].failure == "number 7: ZeroDivisionError: seven is not liked"
    assert of_others[8].result == toy.square(8)


def test_a_study_has_the_same_results_on_a_cluster(
    cluster: Cluster, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plan, folder = tmp_path / "plan.toml", tmp_path / "study"
    plan.write_text(small.TEXT, encoding="utf-8")
    code = main(["study", "run", str(plan), "-o", str(folder), "--scheduler", cluster.address, "--json"])
    out, err = capsys.readouterr()
    assert (code, err) == (0, "")
    answer = json.loads(out)
    assert {method["method"] for method in answer.pop("methods")} == set(
        small.table(Store.open(folder))["method"]
    )
    assert answer == {"plan": "small", "folder": str(folder), "runs": 12, "done_again": []}
    local = run_study(small.plan(), tmp_path / "here", workers=1)
    assert small.table(Store.open(folder)).equals(small.table(local))


def test_workers_of_another_version_are_refused(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The workers have the version of these tests; this study claims another version.
    monkeypatch.setattr(store_module, "revision", lambda: "0123456789ab")
    with pytest.raises(StudyError, match=r"12 of 12 runs failed, the first: .* this worker runs another "):
        run_study(small.plan(), tmp_path / "study", scheduler=cluster.address)
    assert Store.open(tmp_path / "study").results.is_empty()


# Clusters that fail


@pytest.fixture
def fragile(forks: Forks, tmp_path: Path) -> Iterator[Cluster]:
    """Return a cluster without workers that abandons a run when the first worker is lost."""
    folder = tmp_path / "cluster"
    folder.mkdir()
    opened = Cluster(forks, folder, DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES="0")
    yield opened
    opened.close()


def test_a_task_that_loses_its_workers_is_named_and_others_are_done(
    fragile: Cluster, store: ResultStore
) -> None:
    fragile.add_worker()

    def replace_worker(done: int, total: int) -> None:
        if done == total // 4:
            fragile.workers[0].kill()
            fragile.add_worker()

    tasks = toy.tasks(TOTAL, toy.square, 0.03)
    failures = run_tasks(tasks, store, scheduler=fragile.address, on_task=replace_worker)
    assert failures
    assert all(": KilledWorker: " in failure and "\n" not in failure for failure in failures)
    assert len(store.read(TASKS)[0]) == TOTAL - len(failures) > TOTAL // 2
    assert run_tasks(tasks, store, scheduler=fragile.address) == ()
    assert kept(store) == toy.results(TOTAL)


def test_a_lost_scheduler_is_reported_in_one_line(
    fragile: Cluster, store: ResultStore, capfd: pytest.CaptureFixture[str]
) -> None:
    def kill_soon(done: int, total: int) -> None:
        assert (done, total) == (0, TOTAL)
        threading.Timer(1, fragile.scheduler.kill).start()  # the tasks then wait for a worker

    with pytest.raises(ExecutionError) as refusal:
        run_tasks(TASKS, store, scheduler=fragile.address, on_task=kill_soon)
    assert str(refusal.value) == (
        f"the Dask scheduler at {fragile.address} has ended; start it and this command again to continue"
    )
    assert capfd.readouterr() == ("", "")


# Missing clusters


def test_a_scheduler_without_answer_is_refused_in_time_and_no_folder_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    assert dask_cluster.ANSWER_S == 10
    monkeypatch.setattr(dask_cluster, "ANSWER_S", 0.3)
    plan = tmp_path / "plan.toml"
    plan.write_text(small.TEXT, encoding="utf-8")
    with socket.socket() as closed, socket.socket() as silent:
        closed.bind(("127.0.0.1", 0))  # in use, but without a listener
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        for place in (closed, silent):
            address = f"tcp://127.0.0.1:{place.getsockname()[1]}"
            began = time.monotonic()
            code = main(["study", "run", str(plan), "-o", str(tmp_path / "study"), "--scheduler", address])
            took = time.monotonic() - began
            assert code == 2
            out, err = capfd.readouterr()
            assert out == ""
            assert err == (
                f"emaphm: no Dask scheduler answers at '{address}' (no answer within 0.3 s); start one with "
                "'dask scheduler', or leave out --scheduler to use this machine\n"
            )
            # The margin is for a busy machine; Dask itself waits thirty seconds.
            assert 0.3 <= took < 10
    assert not (tmp_path / "study").exists()


@pytest.mark.parametrize(
    ("address", "reason"),
    [
        ("foo", "missing port number"),
        ("tcp://", "missing port number"),
        ("tcp://127.0.0.1", "missing port number"),
        ("http://127.0.0.1:8786", "unknown address scheme 'http'"),
        ("", "missing port number"),
    ],
)
def test_an_invalid_address_is_refused_at_once(
    capfd: pytest.CaptureFixture[str], address: str, reason: str
) -> None:
    began = time.monotonic()
    with pytest.raises(ExecutionError) as refusal:
        list(outcomes(TASKS, scheduler=address))
    assert time.monotonic() - began < 5  # half of the time limit for an answer
    assert f"no Dask scheduler answers at '{address}' ({reason}" in str(refusal.value)
    assert len(str(refusal.value).splitlines()) == 1
    assert capfd.readouterr() == ("", "")


def test_a_notebook_with_a_running_event_loop_can_use_a_cluster() -> None:
    async def cell() -> None:
        list(outcomes(TASKS, scheduler="http://127.0.0.1:8786"))

    with pytest.raises(ExecutionError, match="unknown address scheme 'http'"):
        asyncio.run(cell())


def test_the_address_of_a_worker_is_refused(cluster: Cluster) -> None:
    from distributed.core import rpc

    async def some_worker() -> str:
        async with rpc(cluster.address) as scheduler:
            return next(iter((await scheduler.identity())["workers"]), "")

    # The workers of the cluster were just started and may not have reported yet.
    deadline = time.monotonic() + PATIENCE_S
    while not (address := asyncio.run(some_worker())):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    with pytest.raises(ExecutionError, match=f"no Dask scheduler answers at '{address}' .a worker is there"):
        list(outcomes(TASKS, scheduler=address))


def test_a_missing_dask_is_reported_with_the_package_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ExecutionError, match=r"needs the library 'dask'; .* pip install 'emaphm\[cluster\]'"):
        run_study(small.plan(), tmp_path / "study", scheduler="tcp://127.0.0.1:8786")
    assert not (tmp_path / "study").exists()
