"""Results do not depend on workers, order or interruptions; a run that fails takes no other with it."""

import multiprocessing
import os
import random
import signal
import threading
import time
from collections.abc import Callable, Generator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from emaphm.errors import StudyError
from emaphm.estimation.search import search
from emaphm.execution import processes as local_module
from emaphm.recording import Recording
from emaphm.study import Plan, Store, run_study
from emaphm.study import run as run_module
from emaphm.study import task as task_module
from emaphm.study.plan import Task
from emaphm.study.task import Outcome, attempt, perform

from . import small

PLAN = small.plan(top="noises_A = [0, 0.1]", end='[[methods]]\nmethod = "hybrid"\nturns = 0\n')
TOTAL = 36


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> pl.DataFrame:
    """Return the results of one worker in one go."""
    return small.table(run_study(PLAN, tmp_path_factory.mktemp("undisturbed") / "study", workers=1))


def test_the_undisturbed_study_is_complete(undisturbed: pl.DataFrame) -> None:
    assert undisturbed["index"].to_list() == list(range(TOTAL))
    assert np.isfinite(undisturbed["error_percent"].to_numpy()).all()


# The same bits


@pytest.mark.parametrize("workers", [2, 3])
def test_workers_do_not_change_results(undisturbed: pl.DataFrame, tmp_path: Path, workers: int) -> None:
    store = run_study(PLAN, tmp_path / "study", workers=workers)
    assert small.table(store).equals(undisturbed)
    assert not multiprocessing.active_children()


def test_order_does_not_change_results(
    undisturbed: pl.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def shuffled(
        plan: Plan, tasks: Sequence[Task], workers: int | None, scheduler: str | None
    ) -> Generator[Outcome]:
        order = random.Random(5).sample(tasks, len(tasks))  # noqa: S311 - nothing secret
        assert order != list(tasks)
        yield from outcomes(plan, order, workers, scheduler)

    outcomes = run_module._outcomes
    monkeypatch.setattr(run_module, "_outcomes", shuffled)
    assert small.table(run_study(PLAN, tmp_path / "study", workers=1)).equals(undisturbed)


@pytest.mark.parametrize("workers", [1, 2])
def test_an_interrupted_study_goes_on_and_does_nothing_twice(
    undisturbed: pl.DataFrame, tmp_path: Path, workers: int
) -> None:
    folder = tmp_path / "study"

    def interrupt(done: int, total: int) -> None:
        assert total == TOTAL
        if done == 20:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_study(PLAN, folder, workers=workers, on_run=interrupt)
    kept = {path: path.stat().st_mtime_ns for path in (folder / "runs").iterdir()}
    assert len(kept) == 20
    assert not multiprocessing.active_children()
    told: list[tuple[int, int]] = []
    store = run_study(PLAN, folder, workers=1, on_run=lambda *progress: told.append(progress))
    assert told == [(done, TOTAL) for done in range(20, TOTAL + 1)]
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    assert small.table(store).equals(undisturbed)


def test_methods_share_their_recordings_noise_included(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: dict[tuple[str, int, float], list[np.ndarray[Any, Any]]] = {}
    record = task_module._recording

    def listen(actuator: Any, manoeuvre: Any, task: Task) -> Recording:
        recording = record(actuator, manoeuvre, task)
        seen.setdefault((task.case, task.run, task.noise_A), []).append(recording["current_A"])
        return recording

    monkeypatch.setattr(task_module, "_recording", listen)
    for task in PLAN.tasks:
        perform(PLAN.actuator, PLAN.manoeuvre, task)
    assert len(seen) == 2 * 3 * 2
    for currents in seen.values():
        assert len(currents) == 3
        assert all(np.array_equal(current, currents[0]) for current in currents)
    for case in ("worn", "loose"):
        exact = [seen[case, run, 0.0][0] for run in range(3)]
        noise = [seen[case, run, 0.1][0] - exact[run] for run in range(3)]
        assert np.array_equal(exact[0], exact[1])
        assert not np.array_equal(noise[0], noise[1])
        # 3 × 250 samples tell an rms to 1 / sqrt(1500) = 2.6 %; five of these deviations are 13 %.
        assert np.sqrt(np.mean(np.square(noise))) == pytest.approx(0.1, rel=0.13)


# Runs that fail


@pytest.fixture
def broken(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[Task], bool]], None]:
    """Return what makes the search of chosen runs raise."""

    def break_(which: Callable[[Task], bool]) -> None:
        chosen = {task.seed for task in PLAN.tasks if which(task)}
        searched = search

        def search_or_fail(*arguments: Any, **options: Any) -> Any:
            if options["seed"] in chosen:
                raise ZeroDivisionError("the swarm\nhas gone")
            return searched(*arguments, **options)

        monkeypatch.setattr(task_module, "search", search_or_fail)

    return break_


def test_a_run_that_fails_is_named_and_takes_no_other_with_it(
    undisturbed: pl.DataFrame,
    tmp_path: Path,
    broken: Callable[[Callable[[Task], bool]], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    folder = tmp_path / "study"
    broken(lambda task: (task.case, task.run) == ("loose", 1))
    told: list[tuple[int, int]] = []
    with pytest.raises(StudyError) as refusal:
        run_study(PLAN, folder, workers=1, on_run=lambda *progress: told.append(progress))
    message = str(refusal.value)
    assert len(message.splitlines()) == 1
    assert message.startswith(f"6 of {TOTAL} runs failed, the first: loose, few, run 1: ZeroDivisionError")
    assert f"kept in {folder}" in message
    # Three methods at two noises have failed; the others are there and were counted.
    assert told == [(done, TOTAL) for done in range(TOTAL - 6 + 1)]
    assert Store.open(folder).results.height == TOTAL - 6
    monkeypatch.undo()
    told.clear()
    store = run_study(PLAN, folder, workers=1, on_run=lambda *progress: told.append(progress))
    assert told[0] == (TOTAL - 6, TOTAL)
    assert small.table(store).equals(undisturbed)


def test_every_run_may_fail(tmp_path: Path, broken: Callable[[Callable[[Task], bool]], None]) -> None:
    broken(lambda _: True)
    with pytest.raises(StudyError, match=rf"^{TOTAL} of {TOTAL} runs failed, the first: worn, few, run 0"):
        run_study(PLAN, tmp_path / "study", workers=1)
    assert Store.open(tmp_path / "study").results.is_empty()


def test_what_cannot_be_recorded_is_a_run_that_failed(tmp_path: Path) -> None:
    still = small.plan(("[manoeuvre]", "[manoeuvre]\namplitude = 0"))
    with pytest.raises(StudyError, match=r"12 of 12 runs failed, the first: worn, few, run 0: .*commanded"):
        run_study(still, tmp_path / "study", workers=1)


def test_an_interruption_is_no_failure_of_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(task_module, "search", interrupted)
    with pytest.raises(KeyboardInterrupt):
        attempt(PLAN.actuator, PLAN.manoeuvre, PLAN.tasks[0])


# Worker processes


def test_a_worker_that_dies_ends_the_study_in_one_line(undisturbed: pl.DataFrame, tmp_path: Path) -> None:
    folder = tmp_path / "study"
    victims: list[int] = []

    def kill_one(done: int, total: int) -> None:
        assert total == TOTAL
        if done == 10:
            victims.extend(child.pid or 0 for child in multiprocessing.active_children())
            os.kill(victims[0], signal.SIGKILL)

    with pytest.raises(StudyError, match=r"a worker process died, .*start again to go on") as refusal:
        run_study(PLAN, folder, workers=2, on_run=kill_one)
    assert len(str(refusal.value).splitlines()) == 1
    assert len(victims) == 2
    assert not multiprocessing.active_children()
    assert small.table(run_study(PLAN, folder, workers=1)).equals(undisturbed)


def test_an_interruption_does_not_wait_for_runs_under_way(tmp_path: Path) -> None:
    # One run takes as good as for ever.
    endless = small.plan(("iterations = 5", "iterations = 100000000"), ("runs = 3", "runs = 20"))
    main = threading.main_thread().ident
    assert main is not None
    began: list[float] = []

    def interrupt_soon(done: int, total: int) -> None:
        assert (done <= 2, total) == (True, 80)
        if done == 1:
            began.append(time.monotonic())
            threading.Timer(0.5, signal.pthread_kill, (main, signal.SIGINT)).start()

    with pytest.raises(KeyboardInterrupt):
        run_study(endless, tmp_path / "study", workers=2, on_run=interrupt_soon)
    # Half a second until the interruption; a run would take hours. The rest is for a busy machine.
    assert time.monotonic() - began[0] < 10
    assert not multiprocessing.active_children()


def test_no_more_workers_are_started_than_there_are_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_pool(*_: object) -> None:
        raise AssertionError("one run needs no pool")

    monkeypatch.setattr(local_module, "ProcessPoolExecutor", no_pool)
    folder = tmp_path / "study"
    plan = small.plan(("runs = 3", "runs = 1"))
    run_study(plan, folder, workers=1)
    next((folder / "runs").iterdir()).unlink()
    assert run_study(plan, folder, workers=64).results.height == 4
