"""`emaphm study …`: printed results, exit codes and refusals."""

import json
import os
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from pathlib import Path

import pytest

from emaphm.execution import ResultStore
from emaphm.study import BUILT_IN, Plan, Store
from emaphm.study.analysis.statistics import VARIANT
from emaphm.study.plan import built_in_text
from emaphm.study.store import tasks
from emaphm.study.trials import trials_of
from processes import children, has_loaded
from waiting import wait_for

from .conftest import Emaphm, Refusal
from .documented import undocumented

PLAN = """\
name = "small"
runs = 2

[manoeuvre]
duration = 0.05

[cases]
worn = { friction = 0.3 }

[[methods]]
method = "da"
population = 4
iterations = 3

[[methods]]
method = "dragonfly-thesis"
population = 4
iterations = 3
"""

PATIENCE_S = 60
"""Time limit for the start or end of a process on a busy machine."""

RUN = "study run plan.toml -o out"


@pytest.fixture
def plan(desk: Path) -> Path:
    """Return the file of a plan with four short runs, in the folder `desk`."""
    file = desk / "plan.toml"
    file.write_text(PLAN, encoding="utf-8")
    return file


@pytest.fixture
def study(plan: Path, emaphm: Emaphm) -> Path:
    """Return the folder "out" with the results of that plan."""
    assert emaphm(*RUN.split(), "--workers", "1").code == 0
    return plan.with_name("out")


# Running


def test_run_prints_a_line_for_each_method(plan: Path, emaphm: Emaphm) -> None:
    code, out, err = emaphm(*RUN.split(), "--workers", "1")
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert lines[0] == "small: 4 of 4 runs"
    assert sorted(line.split()[0] for line in lines[3:-1]) == ["da", "dragonfly-thesis"]
    assert lines[-1] == "Results in out; for tables and figures: emaphm study report out"
    results = Store.open(plan.with_name("out")).results
    for method in ("da", "dragonfly-thesis"):
        errors = results.filter(method=method)["error_percent"].to_numpy()
        (line,) = (line.split() for line in lines[3:-1] if line.split()[0] == method)
        assert line[1:4] == [f"{value:.2f}" for value in (errors.mean(), errors.mean(), errors.max())]
        assert line[5] == "12"  # 4 points, 3 times


def test_run_prints_json(plan: Path, emaphm: Emaphm) -> None:
    code, out, err = emaphm(*RUN.split(), "--workers", "1", "--json")
    assert (code, err) == (0, "")
    answer = json.loads(out)
    methods = answer.pop("methods")
    assert answer == {"plan": "small", "folder": "out", "runs": 4, "done_again": []}
    results = Store.open(plan.with_name("out")).results
    assert results.height == 4
    assert {method["method"] for method in methods} == {"da", "dragonfly-thesis"}
    for method in methods:
        assert method["mean_error_percent"] == results.filter(method=method["method"])["error_percent"].mean()


def test_the_columns_that_distinguish_variants_are_documented() -> None:
    assert undocumented(("study", "run"), {"methods": [dict.fromkeys(VARIANT)]}) == []


def test_a_report_does_not_overwrite_files_without_force(study: Path, emaphm: Emaphm) -> None:
    mine = study.with_name("mine")
    mine.mkdir()
    (mine / "report.md").write_text("my own")
    code, _, err = emaphm("study", "report", study, "--out", mine)
    assert code == 2
    assert "--force" in err
    assert (mine / "report.md").read_text() == "my own"


@pytest.mark.usefixtures("study")
def test_a_finished_study_may_be_started_again(emaphm: Emaphm) -> None:
    code, out, err = emaphm(*RUN.split())
    assert (code, err) == (0, "")
    assert out.startswith("small: 4 of 4 runs\n")


def test_a_damaged_row_is_named_in_the_message(study: Path, emaphm: Emaphm) -> None:
    plan = Store.open(study).plan
    name, key = "worn, da, run 1", tasks(plan, trials_of(plan))[2].key
    for line in (f"{RUN} --workers 1", f"{RUN} --workers 1 --json"):
        with sqlite3.connect(study / "results.sqlite") as connection:
            connection.execute("UPDATE results SET wall_seconds = -1 WHERE key = ?", (key,))
        connection.close()
        code, out, err = emaphm(*line.split())
        assert (code, err) == (0, "")
        if line.endswith("--json"):
            assert json.loads(out)["done_again"] == [name]
        else:
            assert out.startswith(f"small: 4 of 4 runs; damaged, and done again: {name}\n")


def test_a_share_of_the_runs_can_be_run_and_the_rest_later(plan: Path, emaphm: Emaphm) -> None:
    code, out, _ = emaphm(*RUN.split(), "--workers", "1", "--share", "0.5")
    assert code == 0
    assert out.startswith("small: 2 of 4 runs\n")
    assert Store.open(plan.with_name("out")).results["run"].to_list() == [0, 0]
    code, out, _ = emaphm(*RUN.split(), "--workers", "1")
    assert out.startswith("small: 4 of 4 runs\n")


def test_results_of_another_version_may_be_mixed_in_on_request(study: Path, emaphm: Emaphm) -> None:
    _disguise(study)
    code, out, err = emaphm(*RUN.split(), "--mix")
    assert (code, err) == (0, "")
    assert out.startswith("small: 4 of 4 runs\n")


def _disguise(study: Path) -> None:
    """Change the version of the first result of a study."""
    plan = Store.open(study).plan
    study_tasks = tasks(plan, trials_of(plan))
    store = ResultStore(study / "results.sqlite")
    outcome = store.read(study_tasks)[0][0]
    outcome.result["revision"] = "0123456789ab"
    with store.writing() as writer:
        writer.keep(study_tasks[0], outcome, "another", 1.0)


# Plans


def test_plans_are_listed(emaphm: Emaphm) -> None:
    code, out, err = emaphm("study", "plans")
    assert (code, err) == (0, "")
    for name, line in zip(BUILT_IN, out.splitlines(), strict=True):
        plan = Plan.load(name)
        assert line.split()[:3] == [name, str(plan.total), "runs"]
        assert line.endswith(plan.description)


def test_plans_are_listed_in_json(emaphm: Emaphm) -> None:
    code, out, err = emaphm("study", "plans", "--json")
    assert (code, err) == (0, "")
    listed = json.loads(out)["plans"]
    assert [plan["name"] for plan in listed] == list(BUILT_IN)
    assert [plan["runs"] for plan in listed] == [Plan.load(name).total for name in BUILT_IN]


def test_a_printed_plan_can_be_read(emaphm: Emaphm) -> None:
    code, out, err = emaphm("study", "plans", "thesis")
    assert (code, err) == (0, "")
    assert Plan.from_toml_text(out) == Plan.load("thesis")
    code, out, err = emaphm("study", "plans", "thesis", "--json")
    assert (code, err) == (0, "")
    assert json.loads(out) == {"name": "thesis", "toml": built_in_text("thesis")}


# What is refused

BAD_LINES = {
    "study run": ("'emaphm study run' requires PLAN", "See emaphm study run --help"),
    "study run plan.toml": ("'emaphm study run' requires --out", "See emaphm study run --help"),
    "study bogus": ('"bogus"', "run"),
    f"{RUN} --workers 0": ("--workers 0", "give 1 or more"),
    f"{RUN} --workers -3": ("--workers -3", "give 1 or more"),
    f"{RUN} --workers two": ("--workers", '"two"', "int"),
    f"{RUN} --share 0": ("a share of 0 cannot be taken", "give more than 0"),
    f"{RUN} --share 2": ("a share of 2 cannot be taken", "up to 1"),
    f"{RUN} --workers 2 --scheduler tcp://127.0.0.1:1": ("--workers and --scheduler exclude each other",),
    "study run thesi -o out": ("'thesi'", "did you mean 'thesis'?"),
    "study run absent.toml -o out": ("absent.toml", "no such plan file", "give the path"),
    "study run good.csv -o out": ("good.csv", "not valid TOML", "line 1"),
    "study run good.toml -o out": ("good.toml", "unknown key"),
    "study run . -o out": (".: is a folder", "give a file in it"),
    "study run plan.toml -o good.csv": ("good.csv is not a folder", "give another name"),
    "study run plan.toml -o good.csv/out": ("good.csv/out cannot be created", "give another place"),
    "study run plan.toml -o .": ("holds something else than a study", "give a new or empty folder"),
    "study plans thesi": ("'thesi'", "did you mean 'thesis'?"),
    "study plans plan.toml": ("'plan.toml'", "only built-in"),
}


@pytest.mark.usefixtures("plan")
@pytest.mark.parametrize(("line", "pieces"), BAD_LINES.items(), ids=BAD_LINES.keys())
def test_bad_lines_are_refused(refused: Refusal, line: str, pieces: tuple[str, ...]) -> None:
    message = refused(*line.split())
    for piece in pieces:
        assert piece in message


BAD_PLANS = {
    "method": ('"da"', '"dda"', ("plan.toml", "'methods.0'", "'dda'", "did you mean 'da'?")),
    "fault": ("friction", "frictoin", ("plan.toml", "case 'worn'", "did you mean 'friction'?")),
    "key": ("runs", "rnus", ("plan.toml", "'rnus'", "did you mean 'runs'?")),
    "nothing": ("worn = { friction = 0.3 }", "", ("plan.toml", "no cases", "nothing to run", "add [cases]")),
    "lines": ('"da"', '"d\\na"', ("plan.toml", "unknown method")),
}


@pytest.mark.parametrize(("old", "new", "pieces"), BAD_PLANS.values(), ids=BAD_PLANS.keys())
def test_bad_plans_are_refused(
    plan: Path, refused: Refusal, old: str, new: str, pieces: tuple[str, ...]
) -> None:
    plan.write_text(PLAN.replace(old, new), encoding="utf-8")
    message = refused(*RUN.split())
    for piece in pieces:
        assert piece in message


def test_the_folder_of_another_plan_is_refused(study: Path, plan: Path, refused: Refusal) -> None:
    assert study.is_dir()
    plan.write_text(PLAN.replace("runs = 2", "runs = 3"), encoding="utf-8")
    assert "out holds results of another plan: 'runs' (2 there, 3 here); give another" in refused(
        *RUN.split()
    )


def test_results_of_another_version_are_refused(study: Path, refused: Refusal) -> None:
    _disguise(study)
    message = refused(*RUN.split())
    assert "out holds results of another version of the models (0123456789ab; this is " in message
    assert "--mix" in message


# Terminals and signals

Start = Callable[..., "subprocess.Popen[bytes]"]


@pytest.fixture
def start(desk: Path) -> Iterator[Start]:
    """Return a function that starts a study of many runs in its own process group."""
    longer = PLAN.replace("runs = 2", "runs = 800").replace("iterations = 3", "iterations = 10")
    (desk / "plan.toml").write_text(longer, encoding="utf-8")
    started = []

    def run(*arguments: str, stderr: int = subprocess.PIPE) -> "subprocess.Popen[bytes]":
        process = subprocess.Popen(  # noqa: S603 - the arguments are this file's
            [sys.executable, "-m", "emaphm.cli", *RUN.split(), *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=stderr,
            cwd=desk,
            env=os.environ | {"TERM": "xterm", "COLUMNS": "120"},
            start_new_session=True,
        )
        started.append(process)
        return process

    yield run
    for process in started:
        process.kill()
        process.communicate()


def _wait_for_results(desk: Path, count: int) -> None:
    wait_for(lambda: _kept(desk / "out" / "results.sqlite") >= count, PATIENCE_S)


def _kept(file: Path) -> int:
    """Return the number of stored results; reading all results repeatedly would take longer than the runs."""
    if not file.exists():
        return 0
    with closing(sqlite3.connect(file, timeout=PATIENCE_S)) as connection, suppress(sqlite3.OperationalError):
        return int(connection.execute("SELECT COUNT(*) FROM results").fetchone()[0])
    return 0  # its table does not exist yet


# Its quick tests: the next two, amid the work of one process and while others start; the exit code of SIGTERM
# in `test_process.py`, and workers that are interrupted amid their work in `tests/execution`.
@pytest.mark.evidence
@pytest.mark.skipif(sys.platform == "win32", reason="needs process groups")
@pytest.mark.parametrize(
    ("kill", "number", "code"),
    [(os.killpg, signal.SIGINT, 130), (os.kill, signal.SIGINT, 130), (os.kill, signal.SIGTERM, 143)],
)
def test_an_interruption_states_how_to_resume(
    start: Start, desk: Path, kill: Callable[[int, int], None], number: int, code: int
) -> None:
    process = start("--workers", "2")
    _wait_for_results(desk, 5)
    kill(process.pid, number)
    out, err = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, out) == (code, b"")
    assert err == b"emaphm: interrupted: finished results are stored in out; the same command resumes\n"
    assert 5 <= Store.open(desk / "out").results.height < 1600
    assert not list(desk.rglob("*.tmp"))


@pytest.mark.skipif(not Path("/proc/self/maps").is_file(), reason="needs process groups and /proc")
def test_an_interruption_while_workers_start_leaves_no_traceback(start: Start) -> None:
    process = start("--workers", "2")
    # A worker has loaded NumPy first, and then has polars, SciPy and Numba before it.
    wait_for(lambda: sum(has_loaded(child, "_multiarray_umath") for child in children(process.pid)) == 2)
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, out) == (130, b"")
    assert err == b"emaphm: interrupted: finished results are stored in out; the same command resumes\n"


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
def test_progress_is_shown_only_on_a_terminal_until_an_interruption(start: Start, desk: Path) -> None:
    terminal, program_side = os.openpty()
    process = start("--workers", "1", stderr=program_side)
    os.close(program_side)
    _wait_for_results(desk, 5)
    output = b""
    while b"/1600" not in output:
        output += os.read(terminal, 65536)
    os.killpg(process.pid, signal.SIGINT)
    while True:
        try:
            piece = os.read(terminal, 65536)
        except OSError:  # on Linux: the other side is closed
            break
        output += piece
    out, _ = process.communicate(timeout=PATIENCE_S)
    os.close(terminal)
    assert (process.returncode, out) == (130, b"")
    assert b"study small" in output
    last = b"emaphm: interrupted: finished results are stored in out; the same command resumes\r\n"
    assert output.endswith(last)
    assert b"Traceback" not in output
    assert 5 <= Store.open(desk / "out").results.height < 1600
    assert not list(desk.rglob("*.tmp"))
