"""A study that is killed at any moment goes on as if nothing had happened."""

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import polars as pl
import pytest

from emaphm.study import Plan, Store, run_study

from . import small

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").is_file(), reason="needs fork, SIGKILL and /proc")

KILLS = 20
EARLY = 4
"""Of these kills, the ones at the very beginning."""

PATIENCE_S = 60
"""For a process to come up or to end on a busy machine."""

PLAN = small.plan(("runs = 3", "runs = 40"))
TOTAL = 160

# A Python that has loaded everything takes a millisecond to fork and a second and a half to start. Polars
# must not have been used before a fork: its threads would be missing in the child.
NURSERY = """
import os, sys, time
from pathlib import Path

from emaphm.study import Plan, run_study
from emaphm.study.task import perform

plan, folder = Plan.model_validate_json(Path(sys.argv[1]).read_text()), sys.argv[2]
perform(plan.actuator, plan.manoeuvre, plan.tasks[0])
write_bytes = Path.write_bytes


def write_half(path, content):
    write_bytes(path, content[:1000])
    print("half", flush=True)
    time.sleep(600)


for line in sys.stdin:
    child = os.fork()
    if not child:
        if line.strip() == "slowly":
            Path.write_bytes = write_half
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
    """Return the results of a study that nobody kills."""
    return small.table(run_study(PLAN, tmp_path_factory.mktemp("undisturbed") / "study", workers=1))


@pytest.fixture
def nursery(tmp_path: Path) -> Iterator[Nursery]:
    """Return a process that starts a study of `PLAN` in the folder "study" at each line on its stdin."""
    (tmp_path / "plan.json").write_text(PLAN.model_dump_json(), encoding="utf-8")
    with subprocess.Popen(  # noqa: S603 - the arguments are this file's
        [sys.executable, "-W", "ignore", "-c", NURSERY, tmp_path / "plan.json", tmp_path / "study"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        yield process
        process.kill()


def _say(nursery: Nursery, line: str) -> None:
    assert nursery.stdin is not None
    nursery.stdin.write(f"{line}\n")
    nursery.stdin.flush()


def _hear(nursery: Nursery) -> str:
    assert nursery.stdout is not None
    return nursery.stdout.readline().strip()


def _wait_until(is_so: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not is_so():
        assert time.monotonic() < deadline
        time.sleep(0.001)


def _wait_for_parts(folder: Path, count: int) -> None:
    _wait_until(lambda: _parts(folder) >= count)


def _parts(folder: Path) -> int:
    return len(list((folder / "runs").glob("*.parquet")))


def _temporaries(folder: Path) -> list[Path]:
    return list(folder.rglob(".*.tmp"))


def test_twenty_kills_leave_no_trace(tmp_path: Path, nursery: Nursery, undisturbed: pl.DataFrame) -> None:
    folder, dice = tmp_path / "study", random.Random(20)  # noqa: S311 - nothing secret
    kept: list[int] = []
    for kill in range(KILLS):
        before = _parts(folder)
        _say(nursery, "start")
        child = int(_hear(nursery))
        if kill >= EARLY:
            _wait_for_parts(folder, min(before + dice.randrange(8), TOTAL))
        # Beginning, reading, searching and writing each take some milliseconds here.
        time.sleep(dice.uniform(0, 0.02))
        os.kill(child, signal.SIGKILL)
        assert int(_hear(nursery)) == signal.SIGKILL
        kept.append(_parts(folder))
        if (folder / "plan.json").exists():
            store = Store.open(folder)
            assert store.damaged == ()
            assert store.results.height == kept[-1]
    assert kept == sorted(kept)
    # The kills have met a study under way, most of them one that got further than the last.
    assert sum(0 < runs < TOTAL for runs in kept) >= KILLS // 2
    assert len(set(kept)) >= KILLS // 2
    _say(nursery, "start")
    _hear(nursery)
    assert int(_hear(nursery)) == 0
    assert small.table(Store.open(folder)).equals(undisturbed)
    assert not _temporaries(folder)
    assert {path.name for path in folder.iterdir()} == {"plan.json", "runs", ".lock"}


def test_a_kill_while_a_run_is_written_leaves_no_half_a_part(
    tmp_path: Path, nursery: Nursery, undisturbed: pl.DataFrame
) -> None:
    folder = tmp_path / "study"
    _say(nursery, "slowly")
    child = int(_hear(nursery))
    assert _hear(nursery) == "half"
    assert [path.stat().st_size for path in _temporaries(folder)] == [1000]
    os.kill(child, signal.SIGKILL)
    assert int(_hear(nursery)) == signal.SIGKILL
    assert len(_temporaries(folder)) == 1
    assert _parts(folder) == 0
    assert small.table(run_study(PLAN, folder, workers=1)).equals(undisturbed)
    assert not _temporaries(folder)


def test_workers_end_with_a_killed_command(tmp_path: Path) -> None:
    plan, folder = tmp_path / "plan.toml", tmp_path / "study"
    plan.write_text(small.with_(("runs = 3", "runs = 10"), ("iterations = 5", "iterations = 100")))
    with subprocess.Popen(  # noqa: S603 - the arguments are this file's
        [sys.executable, "-m", "emaphm.cli", "study", "run", plan, "-o", folder, "--workers", "2"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as command:
        _wait_for_parts(folder, 1)
        helpers = _children(command.pid)
        command.kill()
    assert 0 < _parts(folder) < 40
    assert len(helpers) >= 2
    _wait_until(lambda: not any(map(_lives, helpers)))
    undisturbed = run_study(Plan.load(plan), tmp_path / "other", workers=1)
    resumed = run_study(Plan.load(plan), folder, workers=1)
    assert small.table(resumed).equals(small.table(undisturbed))
    assert not _temporaries(folder)


def _children(parent: int) -> list[int]:
    """Return the processes that `parent` has started."""
    every = [int(path.name) for path in Path("/proc").iterdir() if path.name.isdecimal()]
    return [process for process in every if _stat(process)[1:2] == [str(parent)]]


def _lives(process: int) -> bool:
    # One that has ended is Z until its parent has asked how.
    return _stat(process)[:1] not in ([], ["Z"])


def _stat(process: int) -> list[str]:
    """Return state, parent and so on; empty where there is no such process."""
    try:
        return Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    except OSError:
        return []
