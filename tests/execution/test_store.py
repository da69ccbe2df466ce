"""Results on disk: complete or absent despite kills, simultaneous writers and damaged files."""

import multiprocessing
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from emaphm.errors import EmaphmError, OutputError
from emaphm.execution import Outcome, ResultStore, Task, in_order, run, run_tasks

from . import toy

PATIENCE_S = 60
"""Time limit for the start or end of a process on a busy machine."""

TASKS = toy.tasks(12)


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the file with the results of `TASKS`; tests use copies of it."""
    results = ResultStore(tmp_path_factory.mktemp("filled") / "results.sqlite")
    assert run_tasks(TASKS, results, workers=1) == ()
    return results.path


@pytest.fixture
def store(filled: Path, tmp_path: Path) -> ResultStore:
    """Return a store with the results of `TASKS`."""
    return ResultStore(Path(shutil.copy(filled, tmp_path)))


def sql(store: ResultStore, statement: str) -> None:
    with sqlite3.connect(store.path) as connection:
        connection.execute(statement)
    connection.close()


def kept(store: ResultStore, tasks: list[Task] = TASKS) -> list[int]:
    return sorted(store.read(tasks)[0])


# Stored results


def test_stored_results_are_read_back_unchanged(store: ResultStore) -> None:
    outcomes, damaged = store.read(TASKS)
    assert toy.in_order(list(outcomes.values())) == toy.results(12)
    assert damaged == ()
    assert all(outcome.wall_seconds > 0 for outcome in outcomes.values())
    assert [path.name for path in store.path.parent.iterdir()] == [store.path.name]


def test_no_file_is_created_before_the_first_result(tmp_path: Path) -> None:
    empty = ResultStore(tmp_path / "results.sqlite")
    assert empty.read(TASKS) == ({}, ())
    assert empty.elapsed_seconds() == 0
    assert not empty.path.exists()


def test_only_missing_tasks_are_done(store: ResultStore) -> None:
    progress: list[tuple[int, int]] = []
    more = toy.tasks(15, toy.fail_on_seven)  # the seventh task is already done and is not repeated
    assert run_tasks(more, store, workers=1, on_task=lambda *counts: progress.append(counts)) == ()
    assert progress == [(12, 15), (13, 15), (14, 15), (15, 15)]
    assert kept(store, more) == list(range(15))


def test_outcomes_wait_for_those_of_earlier_tasks(store: ResultStore) -> None:
    """A result in the store or passed to it is the stored result; outcomes not yet passed wait in memory."""
    arriving = iter([Outcome(i, {"number": i, "arrived": True}) for i in (5, 3, 2, 4)])
    all_outcomes = list(
        in_order(TASKS[:6], arriving, store, {0, 1}, keeps=lambda result: result["number"] in (3, 4))
    )
    assert (
        [task.index for task, _ in all_outcomes]
        == [outcome.index for _, outcome in all_outcomes]
        == list(range(6))
    )
    assert [i for i, (_, outcome) in enumerate(all_outcomes) if "arrived" in outcome.result] == [2, 5]
    reversed_order = iter([Outcome(i, i) for i in (2, 1, 0)])
    assert [outcome.result for _, outcome in in_order(TASKS[:3], reversed_order)] == [0, 1, 2]


def test_a_failure_is_returned_and_the_task_is_repeated(tmp_path: Path) -> None:
    store = ResultStore(tmp_path / "results.sqlite")
    failures = run_tasks(toy.tasks(12, toy.fail_on_seven), store, workers=1)
    assert failures == ("number 7: ZeroDivisionError: seven is not liked",)
    assert kept(store) == [n for n in range(12) if n != 7]
    assert run_tasks(TASKS, store, workers=1) == ()
    assert kept(store) == list(range(12))


def test_pauses_between_sessions_do_not_count_as_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = SimpleNamespace(now=1000.0)
    monkeypatch.setattr(run, "time", SimpleNamespace(perf_counter=lambda: clock.now))

    def takes_two_seconds(number: int) -> dict[str, Any]:
        clock.now += 2.0
        return toy.square(number)

    store = ResultStore(tmp_path / "results.sqlite")
    run_tasks(toy.tasks(2, takes_two_seconds), store, workers=1)
    assert store.elapsed_seconds() == 4.0
    clock.now += 100.0
    run_tasks(toy.tasks(5, takes_two_seconds), store, workers=1)
    assert store.elapsed_seconds() == 10.0


# Changed or damaged results


COPY = """\
UPDATE results SET result = (SELECT result FROM results WHERE key = 'key 2'),
digest = (SELECT digest FROM results WHERE key = 'key 2') WHERE key = 'key 3'
"""


@pytest.mark.parametrize(
    "change",
    [
        "UPDATE results SET result = replace(result, '9', '8') WHERE key = 'key 3'",
        "UPDATE results SET result = NULL WHERE key = 'key 3'",
        "UPDATE results SET wall_seconds = 1e3 WHERE key = 'key 3'",
        "UPDATE results SET digest = NULL WHERE key = 'key 3'",
        COPY,
    ],
    ids=["changed", "null", "time", "digest", "copied from another"],
)
def test_a_changed_row_is_detected_and_its_task_is_repeated(store: ResultStore, change: str) -> None:
    sql(store, change)
    outcomes, damaged = store.read(TASKS)
    assert damaged == (3,)
    assert sorted(outcomes) == [n for n in range(12) if n != 3]
    run_tasks(TASKS, store, workers=1)
    assert toy.in_order(list(store.read(TASKS)[0].values())) == toy.results(12)


def test_results_of_other_tasks_do_not_count(store: ResultStore) -> None:
    other_tasks = [Task(n, toy.square, (n,), f"other {n}") for n in range(12)]
    assert store.read(other_tasks) == ({}, ())


def _cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:5000])


def _scribble(path: Path) -> None:
    path.write_text("no results" * 1000, encoding="utf-8")


def _overwrite(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[4096:8192] = os.urandom(4096)
    path.write_bytes(bytes(content))


def _other_tables(path: Path) -> None:
    path.unlink()
    with sqlite3.connect(path) as connection:
        connection.execute("CREATE TABLE results (a, b)")
    connection.close()


def _folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


@pytest.mark.parametrize("spoil", [_cut, _scribble, _overwrite, _other_tables, _folder])
def test_a_damaged_file_is_refused_in_one_line(store: ResultStore, spoil: Callable[[Path], None]) -> None:
    spoil(store.path)
    for use in (lambda: store.read(TASKS), lambda: run_tasks(TASKS, store, workers=1)):
        with pytest.raises(
            EmaphmError, match=f"^{store.path}: (is damaged|cannot be written or read)"
        ) as refused:
            use()
        assert len(str(refused.value).splitlines()) == 1


def test_a_file_with_random_damage_gives_right_results_or_is_refused(store: ResultStore) -> None:
    original, dice = store.path.read_bytes(), random.Random(8)  # noqa: S311 - nothing secret
    right = store.read(TASKS)[0]
    messages: list[str] = []
    for _ in range(150):
        content = bytearray(original)
        for _ in range(dice.choice([1, 3, 30])):
            content[dice.randrange(len(content))] = dice.randrange(256)
        store.path.write_bytes(content[: dice.choice([None, dice.randrange(len(content))])])
        try:
            outcomes, _ = store.read(TASKS)
        except EmaphmError as error:
            messages.append(str(error))
        else:
            assert outcomes.items() <= right.items()
            assert all(outcomes[n].result == right[n].result for n in outcomes)
    assert 0 < len(messages) < 150
    assert all(len(text.splitlines()) == 1 for text in messages)


def test_an_empty_file_holds_no_results(tmp_path: Path) -> None:
    # The file that a process leaves if it is killed between creating the file and its tables.
    store = ResultStore(tmp_path / "results.sqlite")
    store.path.touch()
    assert store.read(TASKS) == ({}, ())
    assert store.elapsed_seconds() == 0
    assert run_tasks(TASKS, store, workers=1) == ()
    assert kept(store) == list(range(12))


def test_a_full_disk_keeps_earlier_results(store: ResultStore) -> None:
    resource = pytest.importorskip("resource")
    many = [Task(n, "x".__mul__, (5000,), f"long {n}") for n in range(20)]
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (store.path.stat().st_size + 20_000, limits[1]))
    try:
        with pytest.raises(OutputError, match="cannot be written or read"):
            run_tasks(many, store, workers=1)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)
    assert kept(store) == list(range(12))
    assert run_tasks(many, store, workers=1) == ()
    assert kept(store, many) == list(range(20))


# Kills


WRITER = """
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from emaphm.execution import Outcome, ResultStore, Task
store = ResultStore(Path(sys.argv[1]))
first, last = int(sys.argv[2]), int(sys.argv[3])
with store.writing() as writer:
    for n in range(first, last):
        result = {"number": n, "square": n**2, "third": n / 3}
        writer.keep(Task(n, print, (), f"key {n}"), Outcome(n, result), sys.argv[2], 1.0)
        print(n, flush=True)
"""


def writer(store: ResultStore, first: int, last: int) -> "subprocess.Popen[str]":
    """Return a process that stores the results of tasks `first` to `last` and prints each stored number."""
    return subprocess.Popen(  # noqa: S603 - the arguments are this file's
        [sys.executable, "-c", WRITER, store.path, str(first), str(last)],
        stdout=subprocess.PIPE,
        text=True,
    )


def test_stored_results_survive_a_kill_at_any_moment(tmp_path: Path) -> None:
    store, dice = ResultStore(tmp_path / "results.sqlite"), random.Random(5)  # noqa: S311 - nothing secret
    all_tasks, done = toy.tasks(4000), 0
    for _ in range(4):
        with writer(store, done, 4000) as process:
            assert process.stdout is not None
            printed = int(process.stdout.readline())
            time.sleep(dice.uniform(0, 0.05))
            process.kill()
            printed = max([printed, *map(int, process.stdout.read().split())])
        outcomes, damaged = store.read(all_tasks)
        # All printed results were stored, at most one more, and no other.
        assert damaged == ()
        assert len(outcomes) - (printed + 1) in {0, 1}
        assert toy.in_order(list(outcomes.values())) == toy.results(len(outcomes))
        done = len(outcomes)
    assert done < 4000


# Simultaneous access


def test_two_simultaneous_writers_lose_no_results(tmp_path: Path) -> None:
    store = ResultStore(tmp_path / "results.sqlite")
    count = 45
    # They overlap in the middle, where each replaces equal results.
    with writer(store, 0, 30) as first, writer(store, 15, count) as second:
        first.communicate(timeout=PATIENCE_S)
        second.communicate(timeout=PATIENCE_S)
    assert (first.returncode, second.returncode) == (0, 0)
    outcomes, damaged = store.read(toy.tasks(count))
    assert damaged == ()
    assert toy.in_order(list(outcomes.values())) == toy.results(count)
    assert store.elapsed_seconds() == 2.0


def test_results_can_be_read_while_another_process_writes(tmp_path: Path) -> None:
    store = ResultStore(tmp_path / "results.sqlite")
    counts = []
    tasks = toy.tasks(40)
    with writer(store, 0, 40) as process:
        while process.poll() is None:
            outcomes, damaged = store.read(tasks)
            assert damaged == ()
            counts.append(len(outcomes))
    assert counts == sorted(counts)
    assert kept(store, tasks) == list(range(40))


def test_a_copy_holds_the_same_results(store: ResultStore, tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    copy = ResultStore(Path(shutil.copy(store.path, tmp_path / "elsewhere" / "copy #1?.sqlite")))
    assert copy.read(TASKS) == store.read(TASKS)
    assert not multiprocessing.active_children()


def test_a_folder_that_does_not_exist_is_refused(tmp_path: Path) -> None:
    store = ResultStore(tmp_path / "absent" / "results.sqlite")
    with pytest.raises(OutputError, match=r"cannot be written or read .*; create the folder and make it wri"):
        run_tasks(TASKS, store, workers=1)


@pytest.mark.parametrize(
    ("said", "remedy"),
    [
        ("attempt to write a readonly database", "make the file and its folder writable, or give another"),
        ("unable to open database file", "create the folder and make it writable, or give another"),
        ("database is locked", "another process writes there"),
        ("database or disk is full", "free space there, or give another"),
        ("disk I/O error", "free space there, or give another"),
    ],
)
def test_the_remedy_follows_from_the_error_of_sqlite(
    store: ResultStore, said: str, remedy: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> sqlite3.Connection:
        raise sqlite3.OperationalError(said)

    monkeypatch.setattr(sqlite3, "connect", refuse)
    with pytest.raises(OutputError) as error:
        store.read(TASKS)
    assert f"({said}); {remedy}" in str(error.value)
