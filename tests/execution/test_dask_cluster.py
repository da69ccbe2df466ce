"""Studies on a Dask scheduler: workers come and go; and every way in which there is no cluster."""

import asyncio
import json
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import polars as pl
import pytest

from emaphm.cli import main
from emaphm.errors import StudyError
from emaphm.execution.dask_cluster import run_on_cluster
from emaphm.study import Store, run_study
from emaphm.study.revision import REVISION
from study import small

pytest.importorskip("distributed")

PATIENCE_S = 60
"""For a process to come up on a busy machine."""

PLAN = small.plan(("runs = 3", "runs = 15"), ("iterations = 5", "iterations = 60"))
TOTAL = 60

ANOTHER_VERSION = "import emaphm.study.task as task; task.REVISION = '0123456789ab'"
"""Loaded by a worker before its first run."""

DOES_NOT_WAIT_LONG = {"DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "5s"}
"""For a worker that has been killed: a scheduler wants its last results, and asks 30 s long by default."""

Process = subprocess.Popen[bytes]


class Cluster:
    """A scheduler and its workers, each a process of its own that says nothing."""

    def __init__(self, folder: Path, **variables: str) -> None:
        self._folder = folder
        self._file = folder / "scheduler.json"
        self.workers: list[Process] = []
        self.scheduler = self._start("scheduler", "--port", "0", **variables)
        deadline = time.monotonic() + PATIENCE_S
        while not self._file.exists():
            assert time.monotonic() < deadline
            time.sleep(0.02)
        self.address: str = json.loads(self._file.read_text(encoding="utf-8"))["address"]

    def add_worker(self, *options: str) -> None:
        """Start a worker of one thread; it need not be there yet."""
        self.workers.append(self._start("worker", "--no-nanny", "--nthreads", "1", *options))

    def _start(self, kind: str, *options: str, **variables: str) -> Process:
        # No port is fixed, so that several clusters do not collide.
        places = ("--host", "127.0.0.1", "--dashboard-address", "127.0.0.1:0", "--no-dashboard")
        return subprocess.Popen(  # noqa: S603 - the arguments are this file's
            [
                sys.executable,
                *("-m", f"distributed.cli.dask_{kind}", "--scheduler-file", self._file),
                *(*places, *options),
            ],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            cwd=self._folder,
            env=os.environ | DOES_NOT_WAIT_LONG | variables,
        )

    def close(self) -> None:
        """End every process, also one that was killed already."""
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """Return a cluster of two workers."""
    opened = Cluster(tmp_path_factory.mktemp("cluster"))
    for _ in range(2):
        opened.add_worker()
    yield opened
    opened.close()


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> pl.DataFrame:
    """Return the results of one worker of this machine."""
    return small.table(run_study(PLAN, tmp_path_factory.mktemp("undisturbed") / "study", workers=1))


# Workers that come and go


def test_a_worker_is_lost_and_another_comes(
    cluster: Cluster, undisturbed: pl.DataFrame, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    told: list[tuple[int, int]] = []

    def replace_worker(done: int, total: int) -> None:
        told.append((done, total))
        if done == 10:
            cluster.workers[0].kill()
            cluster.add_worker()

    store = run_study(PLAN, tmp_path / "study", scheduler=cluster.address, on_run=replace_worker)
    assert small.table(store).equals(undisturbed)
    assert told == [(done, TOTAL) for done in range(TOTAL + 1)]
    assert capfd.readouterr() == ("", "")


def test_a_killed_client_goes_on(cluster: Cluster, undisturbed: pl.DataFrame, tmp_path: Path) -> None:
    plan, folder = tmp_path / "plan.json", tmp_path / "study"
    plan.write_text(PLAN.model_dump_json(), encoding="utf-8")
    program = (
        "import sys; from pathlib import Path; from emaphm.study import Plan, run_study;"
        "plan = Plan.model_validate_json(Path(sys.argv[1]).read_text());"
        "run_study(plan, sys.argv[2], scheduler=sys.argv[3])"
    )
    with subprocess.Popen(  # noqa: S603 - the arguments are this file's
        [sys.executable, "-c", program, plan, folder, cluster.address]
    ) as client:
        deadline = time.monotonic() + PATIENCE_S
        while not list(folder.glob("runs/*.parquet")):
            assert time.monotonic() < deadline
            time.sleep(0.002)
        client.kill()
    assert 0 < Store.open(folder).results.height < TOTAL
    store = run_study(PLAN, folder, scheduler=cluster.address)
    assert small.table(store).equals(undisturbed)


def test_two_studies_at_once_do_not_mix(cluster: Cluster) -> None:
    one, other = small.plan(), small.plan(("friction = 0.3", "friction = 0.9"))
    running = run_on_cluster(one, one.tasks, cluster.address)
    outcomes = [next(running)]
    others = list(run_on_cluster(other, other.tasks, cluster.address))
    outcomes.extend(running)
    for plan, found in ((one, outcomes), (other, others)):
        rows = {outcome.index: outcome.row for outcome in found}
        assert rows.keys() == {task.index for task in plan.tasks}
        assert all((rows[task.index] or {})["truth"] == list(task.truth) for task in plan.tasks)


def test_the_command_runs_on_a_scheduler(
    cluster: Cluster, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plan, folder = tmp_path / "plan.toml", tmp_path / "study"
    plan.write_text(small.TEXT, encoding="utf-8")
    code = main(["study", "run", str(plan), "-o", str(folder), "--scheduler", cluster.address, "--json"])
    out, err = capsys.readouterr()
    assert (code, err) == (0, "")
    assert json.loads(out) == {"plan": "small", "folder": str(folder), "runs": 12, "done_again": []}


def test_what_fails_on_a_worker_is_a_run_that_failed(cluster: Cluster, tmp_path: Path) -> None:
    still = small.plan(("[manoeuvre]", "[manoeuvre]\namplitude = 0"))
    with pytest.raises(StudyError, match=r"12 of 12 runs failed, the first: (worn|loose), .*commanded"):
        run_study(still, tmp_path / "study", scheduler=cluster.address)


# Clusters that let one down


@pytest.fixture
def fragile(tmp_path: Path) -> Iterator[Cluster]:
    """Return a cluster without workers that gives a run up with the first worker lost."""
    folder = tmp_path / "cluster"
    folder.mkdir()
    opened = Cluster(folder, DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES="0")
    yield opened
    opened.close()


def test_a_run_that_loses_its_workers_is_named_and_the_others_are_done(
    fragile: Cluster, undisturbed: pl.DataFrame, tmp_path: Path
) -> None:
    fragile.add_worker()

    def replace_worker(done: int, total: int) -> None:
        if done == total // 2:
            fragile.workers[0].kill()
            fragile.add_worker()

    folder = tmp_path / "study"
    with pytest.raises(StudyError, match=r"runs failed, the first: .*: KilledWorker: ") as refusal:
        run_study(PLAN, folder, scheduler=fragile.address, on_run=replace_worker)
    assert len(str(refusal.value).splitlines()) == 1
    assert TOTAL // 2 < Store.open(folder).results.height < TOTAL
    store = run_study(PLAN, folder, scheduler=fragile.address)
    assert small.table(store).equals(undisturbed)


def test_a_scheduler_that_goes_away_is_said_in_one_line(
    fragile: Cluster, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    def kill_soon(done: int, total: int) -> None:
        assert (done, total) == (0, TOTAL)
        threading.Timer(2, fragile.scheduler.kill).start()  # the study then waits for a worker

    with pytest.raises(StudyError) as refusal:
        run_study(PLAN, tmp_path / "study", scheduler=fragile.address, on_run=kill_soon)
    assert str(refusal.value) == (
        f"the Dask scheduler at {fragile.address} went away; start it and the study again to go on"
    )
    assert capfd.readouterr() == ("", "")


def test_workers_of_another_version_are_refused(fragile: Cluster, tmp_path: Path) -> None:
    fragile.add_worker("--preload", ANOTHER_VERSION)
    with pytest.raises(StudyError) as refusal:
        run_study(PLAN, tmp_path / "study", scheduler=fragile.address)
    assert str(refusal.value) == (
        f"the workers of {fragile.address} run another version of the models (0123456789ab; this is "
        f"{REVISION}); install the same emaphm there"
    )
    assert Store.open(tmp_path / "study").results.is_empty()


# No cluster


def test_a_scheduler_that_does_not_answer_is_refused_within_ten_seconds(tmp_path: Path) -> None:
    plan = tmp_path / "plan.toml"
    plan.write_text(small.TEXT, encoding="utf-8")
    with socket.socket() as closed, socket.socket() as silent:
        closed.bind(("127.0.0.1", 0))  # taken, but nobody listens
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        addresses = [f"tcp://127.0.0.1:{place.getsockname()[1]}" for place in (closed, silent)]
        began = time.monotonic()
        commands = [
            subprocess.Popen(  # noqa: S603 - the arguments are this file's
                _study_run(plan, tmp_path / f"study {i}", address),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
            )
            for i, address in enumerate(addresses)
        ]
        answers = [command.communicate(timeout=PATIENCE_S) for command in commands]
        took = time.monotonic() - began
    for address, command, (out, err) in zip(addresses, commands, answers, strict=True):
        assert (command.returncode, out) == (2, "")
        assert err == (
            f"emaphm: no Dask scheduler answers at '{address}' (no answer within 10 s); start one with "
            "'dask scheduler', or leave out --scheduler to use this machine\n"
        )
    # Ten seconds, and the time that a busy machine takes to start two Pythons; Dask itself waits thirty.
    assert 10 < took < 30


def _study_run(plan: Path, folder: Path, address: str) -> Sequence[str | Path]:
    command = (sys.executable, "-m", "emaphm.cli", "study", "run", plan)
    return [*command, "-o", folder, "--scheduler", address]


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
def test_a_nonsense_address_is_refused_at_once(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], address: str, reason: str
) -> None:
    began = time.monotonic()
    with pytest.raises(StudyError) as refusal:
        run_study(PLAN, tmp_path / "study", scheduler=address)
    assert time.monotonic() - began < 5  # half of what is waited for an answer
    assert f"no Dask scheduler answers at '{address}' ({reason}" in str(refusal.value)
    assert len(str(refusal.value).splitlines()) == 1
    assert capfd.readouterr() == ("", "")


def test_a_notebook_whose_loop_is_running_can_ask_too(tmp_path: Path) -> None:
    async def cell() -> None:
        run_study(PLAN, tmp_path / "study", scheduler="http://127.0.0.1:8786")

    with pytest.raises(StudyError, match="unknown address scheme 'http'"):
        asyncio.run(cell())


def test_a_worker_is_no_scheduler(cluster: Cluster, tmp_path: Path) -> None:
    from distributed.core import rpc

    async def some_worker() -> str:
        async with rpc(cluster.address) as scheduler:
            return next(iter((await scheduler.identity())["workers"]), "")

    # Those of the cluster were just started, and may not have reported yet.
    deadline = time.monotonic() + PATIENCE_S
    while not (address := asyncio.run(some_worker())):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    with pytest.raises(StudyError, match=f"no Dask scheduler answers at '{address}' .a worker is there"):
        run_study(PLAN, tmp_path / "study", scheduler=address)


def test_without_dask_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(StudyError, match=r"needs the library 'dask'; .* pip install 'emaphm\[cluster\]'"):
        run_study(PLAN, tmp_path / "study", scheduler="tcp://127.0.0.1:8786")
