"""Tasks on local processes: same results for any number of workers, and no hang in any case."""

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from emaphm.errors import ExecutionError
from emaphm.execution import ResultStore, outcomes, processes, run_tasks
from processes import children, lives

from . import toy

PATIENCE_S = 60
"""Time limit for the start or end of a process on a busy machine."""

COMMAND = """
import sys
from pathlib import Path
from emaphm.execution import ResultStore, run_tasks
from execution import toy
if __name__ == "__main__":
    tasks = toy.tasks(40, toy.square, 0.05)
    run_tasks(tasks, ResultStore(Path("results.sqlite")), workers=2, on_task=lambda *n: print(*n, flush=True))
"""


@pytest.mark.parametrize("workers", [1, 3])
def test_each_task_is_done_once_for_any_number_of_workers(workers: int) -> None:
    all_outcomes = list(outcomes(toy.tasks(20), workers=workers))
    assert toy.in_order(all_outcomes) == toy.results(20)
    assert all(outcome.failure == "" for outcome in all_outcomes)
    assert not multiprocessing.active_children()


@pytest.mark.parametrize("workers", [1, 2])
def test_a_failed_task_is_named_and_does_not_affect_others(workers: int) -> None:
    by_index = {
        outcome.index: outcome for outcome in outcomes(toy.tasks(10, toy.fail_on_seven), workers=workers)
    }
    assert by_index[7].failure == "number 7: ZeroDivisionError: seven is not liked"
    assert by_index[7].result is None
    assert [by_index[n].result for n in range(10) if n != 7] == [toy.square(n) for n in range(10) if n != 7]


def test_wall_and_cpu_times_are_those_of_the_task() -> None:
    (outcome,) = outcomes(toy.tasks(1, toy.square, 0.2), workers=1)
    assert 0.2 <= outcome.wall_seconds < 2  # the margin is for a busy machine
    assert outcome.cpu_seconds < 0.1  # it sleeps


def test_an_interruption_is_not_reported_as_a_failed_task() -> None:
    def interrupted(_: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        list(outcomes(toy.tasks(1, interrupted), workers=1))


def test_a_dead_worker_is_reported_in_one_line() -> None:
    with pytest.raises(ExecutionError, match=r"a worker process died, .*start again to go on") as refusal:
        list(outcomes(toy.tasks(4, toy.die), workers=2))
    assert len(str(refusal.value).splitlines()) == 1
    assert not multiprocessing.active_children()


def test_workers_ignore_only_ctrl_c() -> None:
    blocked = [outcome.result for outcome in outcomes(toy.tasks(2, toy.blocked), workers=2)]
    assert blocked == [[signal.SIGINT]] * 2


def test_an_interruption_does_not_wait_for_running_tasks(tmp_path: Path) -> None:
    main = threading.main_thread().ident
    assert main is not None
    began: list[float] = []

    def interrupt_soon(done: int, total: int) -> None:
        assert (done <= 1, total) == (True, 4)
        if done == 1:
            began.append(time.monotonic())
            threading.Timer(0.2, signal.pthread_kill, (main, signal.SIGINT)).start()

    with pytest.raises(KeyboardInterrupt):
        run_tasks(
            toy.tasks(4, toy.wait_for_ever),
            ResultStore(tmp_path / "results.sqlite"),
            workers=2,
            on_task=interrupt_soon,
        )
    # A task would take an hour. The margin is for a busy machine.
    assert time.monotonic() - began[0] < 10
    assert not multiprocessing.active_children()


def test_no_more_workers_are_started_than_there_are_tasks(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_pool(*_: object) -> None:
        raise AssertionError("one task needs no pool")

    monkeypatch.setattr(processes, "ProcessPoolExecutor", no_pool)
    assert toy.in_order(list(outcomes(toy.tasks(1), workers=64))) == toy.results(1)
    assert list(outcomes([], workers=64)) == []


def test_workers_have_one_thread_each_and_the_environment_is_unchanged(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "3")
    with processes._one_thread_each():
        assert (os.environ["OMP_NUM_THREADS"], os.environ["OPENBLAS_NUM_THREADS"]) == ("1", "3")
    assert "OMP_NUM_THREADS" not in os.environ
    assert os.environ["OPENBLAS_NUM_THREADS"] == "3"


@pytest.mark.skipif(not Path("/proc/self/stat").is_file(), reason="needs SIGKILL and /proc")
def test_workers_end_with_a_killed_command_and_its_results_are_kept(tmp_path: Path) -> None:
    script = tmp_path / "command.py"
    script.write_text(COMMAND, encoding="utf-8")
    tests = str(Path(__file__).parents[1])
    with subprocess.Popen(  # noqa: S603 - the arguments are this file's
        [sys.executable, script],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([tests, os.environ.get("PYTHONPATH", "")])},
        stdout=subprocess.PIPE,
        text=True,
    ) as command:
        assert command.stdout is not None
        assert [command.stdout.readline() for _ in range(3)] == ["0 40\n", "1 40\n", "2 40\n"]
        helpers = children(command.pid)
        command.kill()
    assert len(helpers) >= 2
    deadline = time.monotonic() + PATIENCE_S
    while any(map(lives, helpers)):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    store, tasks = ResultStore(tmp_path / "results.sqlite"), toy.tasks(40)
    assert 2 <= len(store.read(tasks)[0]) < 40
    assert run_tasks(tasks, store, workers=1) == ()
    assert toy.in_order(list(store.read(tasks)[0].values())) == toy.results(40)
