"""The command as a process: exit codes, signals, pipes, terminals, encodings and loaded modules."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from emaphm.cli import main

from .conftest import Emaphm
from .terminal import Forks, forks

HEAVY = ("numba", "scipy", "polars", "matplotlib", "pydantic", "numpy", "jinja2", "sqlalchemy", "alembic")

ON_POSIX = pytest.mark.skipif(sys.platform == "win32", reason="needs a POSIX shell and signals")

ON_A_TERMINAL = pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")

Start = Callable[..., "subprocess.Popen[bytes]"]

PATIENCE_S = 120
"""Time limit; long enough to compile the kernels for the first time on a busy machine."""


def environment(**changes: str) -> dict[str, str]:
    """Return this process's environment without the variables that change Python's streams."""
    dropped = (
        "PYTHONUNBUFFERED",
        "PYTHONIOENCODING",
        "PYTHONUTF8",
        "COLUMNS",
        "TERM",
        "FORCE_COLOR",
        "TTY_COMPATIBLE",
    )
    return {name: value for name, value in os.environ.items() if name not in dropped} | changes


ALL = """
import sys
from emaphm.cli import main
for line in sys.argv[1:]:
    print(f"== {main(line.split())}", flush=True)
"""
"""Runs several command lines in one process, whose start takes longer than the commands."""


@pytest.fixture
def start(desk: Path) -> Start:
    """Return a function that starts `emaphm` in the folder `desk`."""

    def run(
        *arguments: str, stdout: int, stderr: int = subprocess.PIPE, **variables: str
    ) -> "subprocess.Popen[bytes]":
        return subprocess.Popen(  # noqa: S603 - the arguments are this file's
            [sys.executable, "-m", "emaphm.cli", *arguments],
            stdin=subprocess.DEVNULL,
            stdout=stdout,
            stderr=stderr,
            cwd=desk,
            env=environment(**variables),
        )

    return run


def ended(process: "subprocess.Popen[bytes]") -> tuple[int, str, str]:
    """Return a process's exit code, stdout and stderr."""
    out, err = process.communicate(timeout=PATIENCE_S)
    return process.returncode, (out or b"").decode(), (err or b"").decode()


def test_help_loads_no_heavy_modules() -> None:
    # One process is enough: a module that the help of any verb loads stays loaded.
    code = """
import json, sys
from emaphm.cli import main
for verb in sys.argv[1:]:
    main([verb, "--help"] if verb else ["--help"])
print(json.dumps([*sys.modules]))
"""
    verbs = ["", "demo", "simulate", "diagnose", "calibrate", "replay", "history", "watch"]
    done = subprocess.run(  # noqa: S603 - the arguments are this file's
        [sys.executable, "-c", code, *verbs],
        capture_output=True,
        text=True,
        check=True,
        env=environment(),
    )
    for verb in verbs:
        assert f"Usage: emaphm {verb}".rstrip() in done.stdout
    loaded = json.loads(done.stdout.splitlines()[-1])
    assert "emaphm.cli" in loaded
    assert not {name.partition(".")[0] for name in loaded} & set(HEAVY)


@pytest.mark.parametrize(
    ("line", "code"),
    [("--version", 0), ("bogus", 2)],
)
def test_exit_codes(start: Start, line: str, code: int) -> None:
    returned, out, err = ended(start(*line.split(), stdout=subprocess.PIPE))
    assert returned == code
    assert bool(out) == (code == 0)
    assert len(err.splitlines()) == (code == 2)


def test_the_package_run_as_a_module_is_the_command_with_its_workers(desk: Path) -> None:
    (desk / "other.csv").write_bytes((desk / "good.csv").read_bytes())
    quick = ("--model", "averaged", "--nuisance", "none", "--no-correction", "--workers", "2", "--json")
    done = subprocess.run(  # noqa: S603 - the arguments are this file's
        [sys.executable, "-m", "emaphm", "diagnose", "good.csv", "other.csv", *quick],
        capture_output=True,
        check=False,
        cwd=desk,
        env=environment(),
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert [json.loads(line)["recording"] for line in done.stdout.splitlines()] == ["good.csv", "other.csv"]


@pytest.mark.skipif(sys.platform == "win32", reason="scripts are named otherwise there")
def test_the_installed_command_runs_whatever_files_the_folder_holds(desk: Path) -> None:
    script = Path(sys.executable).with_name("emaphm")
    if not script.is_file():
        pytest.skip("emaphm is not installed beside this Python")
    for name in ("emaphm.py", "numpy.py", "json.py", "polars.py"):
        (desk / name).write_text("raise RuntimeError('not this one')\n", encoding="utf-8")
    done = subprocess.run(  # noqa: S603 - the arguments are this file's
        [script, "replay", "good.csv", "--json"],
        capture_output=True,
        check=False,
        cwd=desk,
        env=environment(),
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert "relative_error" in json.loads(done.stdout)


def test_an_internal_error_is_not_hidden(emaphm: Emaphm, desk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError

    assert desk.is_dir()
    monkeypatch.setattr("emaphm.recording.read_recording", broken)
    # The interpreter turns it into a traceback and exit code 1.
    with pytest.raises(ZeroDivisionError):
        emaphm("replay", "good.csv")


# Pipes and full disks


@pytest.mark.parametrize(
    ("line", "unbuffered"),
    [("completion bash", "1"), ("init --from dc -o out.toml", "")],
)
def test_a_closed_pipe_is_no_error(start: Start, line: str, unbuffered: str) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    process = start(*line.split(), stdout=writing, PYTHONUNBUFFERED=unbuffered)
    os.close(writing)
    code, _, err = ended(process)
    assert (code, err) == (0, "")


@pytest.mark.parametrize("line", ["diagnose --help", "--version"])
def test_a_closed_pipe_is_no_error_for_help(start: Start, line: str) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    process = start(*line.split(), stdout=writing)
    os.close(writing)
    code, _, err = ended(process)
    assert (code, err) == (0, "")


@ON_POSIX
@pytest.mark.parametrize(
    ("closed", "line", "code", "said"),
    [
        (">&-", "--help", 2, "stdout is closed"),
        # Noticed before the work: the file is not read.
        (">&-", "diagnose absent.csv", 2, "stdout is closed"),
        ("2>&-", "bogus", 2, ""),
        (">&- 2>&-", "replay good.csv", 2, ""),
        ("<&- 2>&-", "replay good.csv", 0, ""),
        ("1</dev/null", "--version", 2, "stdout cannot be written: it is not open for writing"),
    ],
)
def test_closed_streams_end_with_an_exit_code(
    desk: Path, closed: str, line: str, code: int, said: str
) -> None:
    done = subprocess.run(  # noqa: S603 - the arguments are this file's
        ["/bin/sh", "-c", f'exec "$0" -m emaphm.cli {line} {closed}', sys.executable],
        capture_output=True,
        text=True,
        check=False,
        cwd=desk,
        env=environment(),
    )
    assert done.returncode == code
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) == bool(said)
    assert said in done.stderr


@ON_POSIX
@pytest.mark.parametrize("module", ["signal", "cyclopts", "rich.console"])
def test_an_early_interruption_shows_no_traceback(desk: Path, module: str) -> None:
    # The interruption comes at a given import, whatever the speed of the machine.
    code = f"""
import os, signal, sys
class Interrupting:
    def find_spec(self, name, *_):
        if name == {module!r}:
            os.kill(os.getpid(), signal.SIGINT)
if {module!r} == "signal":
    del sys.modules["signal"]
sys.meta_path.insert(0, Interrupting())
from emaphm.cli import main
sys.argv = ["emaphm", "--help"]
sys.exit(main())
"""
    done = subprocess.run(  # noqa: S603 - the arguments are this file's
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=desk, env=environment()
    )
    assert done.returncode in {-signal.SIGINT, 130}  # a shell returns 130 in both cases
    assert done.stdout == ""
    assert done.stderr in {"", "emaphm: interrupted\n"}


@ON_POSIX
def test_sigterm_ends_a_background_command_that_ignores_ctrl_c(desk: Path) -> None:
    code = """
import os, signal, sys
import emaphm.recording
from emaphm.cli import main
def signalled(*_, **__):
    os.kill(os.getpid(), signal.SIGINT)
    print("goes on", flush=True)
    os.kill(os.getpid(), signal.SIGTERM)
emaphm.recording.read_recording = signalled
signal.signal(signal.SIGINT, signal.SIG_IGN)
sys.argv = ["emaphm", "replay", "good.csv"]
sys.exit(main())
"""
    done = subprocess.run(  # noqa: S603 - the arguments are this file's
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=desk, env=environment()
    )
    assert (done.returncode, done.stdout, done.stderr) == (143, "goes on\n", "emaphm: interrupted\n")


@pytest.mark.skipif(sys.platform == "win32", reason="needs a limit on the size of files")
def test_a_full_disk_leaves_no_partial_files(emaphm: Emaphm, desk: Path) -> None:
    # The kernel's own cache on disk is larger than the limit, and must be there before.
    assert emaphm("simulate", "warm.csv", "--model", "averaged").code == 0
    (desk / "warm.csv").unlink()
    limited = f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, 50_000)){ALL}"
    names = ("out.csv", "out.parquet")
    done = subprocess.run(  # noqa: S603 - the arguments are this file's
        [sys.executable, "-c", limited, *(f"simulate {name} --model averaged" for name in names)],
        capture_output=True,
        text=True,
        check=False,
        cwd=desk,
        env=environment(),
    )
    assert (done.returncode, done.stdout) == (0, "== 2\n" * 2)
    for name, line in zip(names, done.stderr.splitlines(), strict=True):
        assert f"{name}: cannot be written (File too large" in line
    assert {path.name for path in desk.iterdir()} == {"good.csv", "good.toml"}


# Terminals and signals


@pytest.fixture(scope="module")
def terminals() -> Iterator[Forks]:
    """Return a process that runs programs with stderr on a terminal."""
    with forks(environment(TERM="xterm")) as started:
        yield started


COMMAND = """
import sys
from emaphm.cli import main
sys.exit(main())
"""
"""Runs the command line."""


@ON_A_TERMINAL
def test_progress_is_shown_on_a_terminal_and_not_on_stdout(terminals: Forks, desk: Path) -> None:
    line = ("diagnose", "good.csv", "--no-correction", "--nuisance", "none")
    code, out, terminal_output = terminals.run(desk, desk / "stdout", COMMAND, *line)
    assert code == 0
    assert "95 % interval" in out
    assert b"diagnosing" in terminal_output
    assert b"100%" in terminal_output
    assert "\x1b" not in out
    assert "diagnosing" not in out


AMID_THE_WORK = """
import os, signal, sys
from rich.progress import Progress
class Interrupted(Progress):
    drawn = 0
    def get_renderable(self):
        if self.tasks and self.tasks[0].description.startswith(bar):
            self.drawn += 1
            if self.drawn == 2:
                os.kill(os.getpid(), signal.SIGINT)
        return super().get_renderable()
bar = sys.argv.pop(1)
sys.modules["rich.progress"].Progress = Interrupted
from emaphm.cli import main
sys.exit(main())
"""
"""Runs the command line, interrupted when `bar` is drawn for the second time.

This is after the start of the work and before its result is written. From another process, an
interruption may come too late: if the work is done and the interpreter is shutting down, the signal ends
the process, for which a shell also returns 130.
"""


@ON_A_TERMINAL
@pytest.mark.parametrize(
    ("line", "bar"),
    [
        ("simulate out.csv --duration 20", "simulating"),
        ("diagnose good.csv --method dragonfly-thesis --report out.html", "diagnosing"),
        ("calibrate good.csv --free inertia,viscous,coulomb -o out.toml", "calibrating"),
    ],
)
def test_an_interruption_ends_the_command_without_traceback_or_partial_files(
    terminals: Forks, desk: Path, tmp_path_factory: pytest.TempPathFactory, line: str, bar: str
) -> None:
    stdout_file = tmp_path_factory.mktemp("said") / "stdout"
    code, out, terminal_output = terminals.run(desk, stdout_file, AMID_THE_WORK, bar, *line.split())
    assert (code, out) == (130, ""), terminal_output.decode(errors="replace")
    assert bar.encode() in terminal_output
    assert b"interrupted" in terminal_output
    assert b"Traceback" not in terminal_output
    assert {path.name for path in desk.rglob("*")} == {"good.csv", "good.toml"}


LOST = """
import os, signal, sys
from rich.progress import Progress
def interrupt(self=None):
    os.kill(os.getpid(), signal.SIGINT)
def swallow():
    try:
        interrupt()
    except KeyboardInterrupt:
        pass
def report():
    try:
        interrupt()
    except KeyboardInterrupt:
        sys.excepthook(*sys.exc_info())  # what C does by PyErr_Print
def convert():
    try:
        interrupt()
    except KeyboardInterrupt as error:
        raise ImportError("of a library") from error
def drop():
    type("Dropped", (), {"__del__": interrupt})()
def add_task(self, *names, **settings):
    lose()
    return added(self, *names, **settings)
added, Progress.add_task, lose = Progress.add_task, add_task, globals()[sys.argv.pop(1)]
from emaphm.cli import main
sys.exit(main())
"""
"""Runs the command line and loses an interruption at the start of the work, as libraries do while loading."""


@ON_A_TERMINAL
@pytest.mark.parametrize("way", ["swallow", "report", "convert", "drop"])
def test_an_interruption_swallowed_by_a_library_still_ends_the_command(
    terminals: Forks, desk: Path, way: str
) -> None:
    line = ("diagnose", "good.csv", "--no-correction")
    code, out, terminal_output = terminals.run(desk, desk / "stdout", LOST, way, *line)
    assert (code, out) == (130, "")
    assert terminal_output.endswith(b"emaphm: interrupted\r\n")
    assert b"Traceback" not in terminal_output


def test_an_interruption_is_reported(
    desk: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    assert desk.is_dir()
    monkeypatch.setattr("emaphm.recording.read_recording", interrupted)
    assert main(["replay", "good.csv"]) == 130
    assert capsys.readouterr() == ("", "emaphm: interrupted\n")


# Encodings


def test_stdout_works_in_ascii_and_files_are_utf_8_in_all_locales(desk: Path) -> None:
    diagnosed = "diagnose good.csv --model averaged --no-correction --nuisance none"
    calibrated = "calibrate good.csv --free inertia --no-correction --nuisance none -o out.toml --json"
    lines = ("replay good.csv", diagnosed, "simulate --help", calibrated)
    done = subprocess.run(  # noqa: S603 - the arguments are this file's
        [sys.executable, "-c", ALL, *lines],
        capture_output=True,
        check=False,
        cwd=desk,
        env=environment(PYTHONIOENCODING="ascii", LC_ALL="C", PYTHONUTF8="0", PYTHONCOERCECLOCALE="0"),
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout.isascii()
    outputs = done.stdout.decode().split("== 0\n")
    assert len(outputs) == len(lines) + 1
    assert all(outputs[: len(lines)])
    assert json.loads(outputs[3])["parameters"]["inertia"]["unit"] == "kg·m²"
    assert "# kg·m²" in (desk / "out.toml").read_text(encoding="utf-8")


def test_a_message_can_be_printed_in_ascii(start: Start) -> None:
    process = start("replay", "räder ×.csv", stdout=subprocess.PIPE, PYTHONIOENCODING="ascii")
    code, out, err = ended(process)
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert "no such file" in err


def test_main_works_as_a_function_whatever_ran_before(emaphm: Emaphm) -> None:
    from emaphm import cli

    assert emaphm("--version").code == 0
    modules = {path.stem for path in Path(cli.__file__).parent.iterdir()}
    assert cli.main is main
    assert not modules & set(cli.__all__)
