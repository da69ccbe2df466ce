"""A study killed at any moment is resumed with the same results."""

import os
import random
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import polars as pl
import pytest

from emaphm.study import Store, run_study

from . import small

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").is_file(), reason="needs fork, SIGKILL and /proc")

KILLS = 8
EARLY = 2
"""Number of these kills at the very beginning."""

PATIENCE_S = 60
"""Time limit for the start or end of a process on a busy machine."""

PLAN = small.plan(("runs = 3", "runs = 20"))
TOTAL = 80

# A Python that has loaded all modules takes a millisecond to fork and a second and a half to start. Polars
# must not be used before a fork: its threads would be missing in the child.
NURSERY = """
import os, sys, time
from pathlib import Path

from emaphm.execution.store import Writer
from emaphm.study import Plan, run_study
from emaphm.study.revision import revision
from emaphm.study.task import perform
from emaphm.study.trials import trials_of

plan = Plan.model_validate_json(Path(sys.argv[1]).read_text())
perform(plan.actuator, plan.manoeuvre, trials_of(plan)[0], revision())


def keep_half(self, task, *_):
    self.connection.execute("PRAGMA cache_size = 2")  # so that pages are written before the transaction ends
    self.connection.execute("BEGIN IMMEDIATE")
    for n in range(100):
        row = (f"half {n}", "half" * 1000, 0, 0, "")
        self.connection.execute("INSERT INTO results VALUES (?, ?, ?, ?, ?)", row)
    print("half", flush=True)
    time.sleep(600)


for line in sys.stdin:
    how, _, folder = line.strip().partition(" ")
    child = os.fork()
    if not child:
        if how == "slowly":
            Writer.keep = keep_half
        ended = 1
        try:
            run_study(plan, folder, workers=1)
            ended = 0
        finally:
            os._exit(ended)
    print(child, flush=True)
    print(os.waitpid(child, 0)[1], flush=True)
"""

Nursery = subprocess.Popen[str]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> pl.DataFrame:
    """Return the results of a study that is not killed."""
    return small.table(run_study(PLAN, tmp_path_factory.mktemp("undisturbed") / "study", workers=1))


@pytest.fixture(scope="module")
def nursery(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Nursery]:
    """Return a process that starts a study of `PLAN` in the folder that each line on its stdin names."""
    plan = tmp_path_factory.mktemp("nursery") / "plan.json"
    plan.write_text(PLAN.model_dump_json(), encoding="utf-8")
    with subprocess.Popen(  # noqa: S603 - the arguments are this file's
        [sys.executable, "-W", "ignore", "-c", NURSERY, plan],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        yield process
        process.kill()


def _send_line(nursery: Nursery, line: str) -> None:
    assert nursery.stdin is not None
    nursery.stdin.write(f"{line}\n")
    nursery.stdin.flush()


def _read_line(nursery: Nursery) -> str:
    assert nursery.stdout is not None
    return nursery.stdout.readline().strip()


def _wait_until(is_so: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not is_so():
        assert time.monotonic() < deadline
        time.sleep(0.001)


def _wait_for_results(folder: Path, count: int) -> None:
    _wait_until(lambda: _results(folder) >= count)


def _results(folder: Path) -> int:
    """Return the number of stored results; wait if a writer is active."""
    if not (folder / "results.sqlite").exists():
        return 0
    with closing(sqlite3.connect(folder / "results.sqlite", timeout=PATIENCE_S)) as connection:
        try:
            return int(connection.execute("SELECT COUNT(*) FROM results").fetchone()[0])
        except sqlite3.OperationalError:  # its table does not exist yet
            return 0


def _other_files(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if path.name not in ("plan.json", "results.sqlite", ".lock")]


def test_a_study_killed_repeatedly_has_the_same_results(
    tmp_path: Path, nursery: Nursery, undisturbed: pl.DataFrame
) -> None:
    folder, dice = tmp_path / "study", random.Random(20)  # noqa: S311 - nothing secret
    counts: list[int] = []
    for kill in range(KILLS):
        count_before = _results(folder)
        _send_line(nursery, f"start {folder}")
        child = int(_read_line(nursery))
        if kill >= EARLY:
            _wait_for_results(folder, min(count_before + dice.randrange(4), TOTAL))
        # Beginning, reading, searching and writing each take some milliseconds here.
        time.sleep(dice.uniform(0, 0.02))
        os.kill(child, signal.SIGKILL)
        assert int(_read_line(nursery)) == signal.SIGKILL
        counts.append(_results(folder))
        if (folder / "plan.json").exists():
            store = Store.open(folder)
            assert store.damaged == ()
            assert store.results.height == counts[-1]
    assert counts == sorted(counts)
    # The kills met a running study, and most of them after further progress.
    assert sum(0 < runs < TOTAL for runs in counts) >= KILLS // 2
    assert len(set(counts)) >= KILLS // 2
    _send_line(nursery, f"start {folder}")
    _read_line(nursery)
    assert int(_read_line(nursery)) == 0
    assert small.table(Store.open(folder)).equals(undisturbed)
    assert not _other_files(folder)


def test_a_kill_while_a_result_is_written_leaves_no_part_of_it(
    tmp_path: Path, nursery: Nursery, undisturbed: pl.DataFrame
) -> None:
    folder = tmp_path / "study"
    _send_line(nursery, f"slowly {folder}")
    child = int(_read_line(nursery))
    assert _read_line(nursery) == "half"
    # Some 400 kB of pages of an unfinished transaction, and the pages that they replace.
    assert (folder / "results.sqlite").stat().st_size > 200_000
    assert [path.name for path in _other_files(folder)] == ["results.sqlite-journal"]
    os.kill(child, signal.SIGKILL)
    assert int(_read_line(nursery)) == signal.SIGKILL
    assert _results(folder) == 0
    resumed = small.table(run_study(PLAN, folder, share=0.15, workers=1))
    assert resumed.height == 12
    assert resumed.equals(undisturbed.head(12))
    assert not _other_files(folder)
