"""`emaphm watch`: arriving files and rows become events, with real diagnoses."""

import importlib
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest

from amortized.toys import CHIRP, THESIS, constant_estimator, short_setup
from emaphm.actuator import Actuator, Faults
from emaphm.cli import main
from emaphm.diagnosis import Diagnosis
from emaphm.history import History
from emaphm.monitoring import WATCH, diagnosers
from emaphm.monitoring.folder import FolderSource
from emaphm.recording import Recording, write_recording
from emaphm.simulated_recording import simulate
from waiting import signal_once, wait_for

from . import files
from .conftest import Refusal

NAME = ("--name", "{unit}_{hours}.csv")


pytestmark = pytest.mark.usefixtures("warm_workers")


@pytest.fixture(autouse=True)
def _looks_often(monkeypatch: pytest.MonkeyPatch) -> None:
    often = replace(WATCH, folder=replace(WATCH.folder, poll_s=0.1))
    monkeypatch.setattr("emaphm.monitoring.WATCH", often)
    module = importlib.import_module("emaphm.monitoring.watch")  # a function has its name
    monkeypatch.setattr(module, "IDLE_S", 0.01)


@pytest.fixture(scope="module")
def arrived(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with three recordings of a unit, two with high friction, and a damaged file."""
    from emaphm.actuator import Chirp

    folder = tmp_path_factory.mktemp("arrived")
    # With these seeds, a diagnosis takes a third of the steps of other seeds.
    for number, (friction, seed) in enumerate(((0.0, 2), (0.3, 3), (0.3, 2))):
        faults = Faults(friction=friction)
        recording = simulate(THESIS, Chirp(duration=0.2), faults=faults, duration=0.2, noise=0.05, seed=seed)
        # With fewer channels, a diagnosis takes half the time.
        reduced = Recording({name: recording[name] for name in ("time_s", "command_rad", "current_A")})
        write_recording(reduced, folder / f"SN-7_{100 + number}.csv")
    (folder / "SN-7_90.csv").write_text("no recording")
    return folder


def test_recordings_of_a_folder_are_diagnosed_and_events_are_printed(
    arrived: Path, desk: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(arrived, desk / "in")
    line = ["watch", "in", *NAME, "--once", "--settle", "0", "--db", "h.sqlite"]
    assert main(line) == 0
    out, err = capfd.readouterr()
    (refused,) = [json.loads(one) for one in out.splitlines() if "SN-7_90" in one]
    assert refused["event"] == "refused"
    events = [json.loads(one) for one in out.splitlines()]
    assert len(events) == 4  # without --new-units, all are refused
    assert "--new-units" in events[-1]["message"]
    assert "0 recordings diagnosed" in err
    assert main([*line, "--new-units", "--raise-after", "2"]) == 0
    out, err = capfd.readouterr()
    events = [json.loads(one) for one in out.splitlines()]
    assert [(one["event"], one["hours"]) for one in events] == [("health_changed", 101), ("alarm", 102)]
    assert events[1]["subject"] == "friction"
    assert events[1]["details"]["value"] == pytest.approx(0.3, abs=0.03)
    assert events[1]["details"]["false_alarms"]["recordings_per_hour"] == 1.0
    assert "3 recordings diagnosed, 0 already in the history, 1 refused;" in err
    with History.open("h.sqlite") as history:
        assert len(history.unit("SN-7").diagnoses()) == 3
        assert history.prognoses()["SN-7"].diagnoses == 3


@pytest.mark.usefixtures("desk", "no_prognoses")
def test_rows_on_standard_input_are_diagnosed(
    arrived: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    with (arrived / "SN-7_101.csv").open() as rows:
        monkeypatch.setattr(sys, "stdin", rows)
        assert main(["watch", "-", "--unit", "A", "--hours", "5", "--new-units"]) == 0
    out, err = capfd.readouterr()
    (event,) = [json.loads(one) for one in out.splitlines()]
    assert (event["event"], event["unit"], event["subject"]) == ("health_changed", "A", "friction")
    assert event["details"]["value"] == pytest.approx(0.3, abs=0.03)
    assert "1 recording diagnosed" in err


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 0), (signal.SIGINT, 130)])
def test_a_signal_ends_the_watch_while_no_file_arrives(
    desk: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], number: int, code: int
) -> None:
    (desk / "in").mkdir()
    looked, look = threading.Event(), FolderSource.next

    def noted(self: FolderSource) -> object:
        looked.set()
        return look(self)

    monkeypatch.setattr(FolderSource, "next", noted)
    with signal_once(number, looked.is_set, lambda: None):
        assert main(["watch", "in"]) == code
    assert "Traceback" not in capfd.readouterr().err


# Quick forms: the test above, and as a process the test below.
@pytest.mark.evidence
@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 0), (signal.SIGINT, 130)])
def test_a_signal_ends_the_process(desk: Path, number: int, code: int) -> None:
    (desk / "in").mkdir()
    line = [sys.executable, "-m", "emaphm.cli", "watch", "in"]
    with subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:  # noqa: S603
        assert process.stderr is not None
        assert "watching in" in process.stderr.readline()
        time.sleep(0.3)
        process.send_signal(number)
        assert process.wait(60) == code
        assert "Traceback" not in process.stderr.read()


def test_the_exit_code_shows_that_files_are_left(arrived: Path, desk: Path) -> None:
    shutil.copytree(arrived, desk / "in")
    line = [sys.executable, "-m", "emaphm.cli", "watch", "in", *NAME, "--once", "--new-units"]
    with subprocess.Popen(  # noqa: S603 - the arguments are this file's
        line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        assert process.stderr is not None
        assert "watching in" in process.stderr.readline()
        os.killpg(process.pid, signal.SIGTERM)  # also to the process that diagnoses, as systemd sends it
        assert process.wait(60) == 143
        assert process.stderr.read().endswith(
            "emaphm: interrupted: finished diagnoses are in the history; the same command resumes\n"
        )


def hangs(recording: Recording, actuator: Actuator, *, seed: int) -> Diagnosis:  # noqa: ARG001
    """Take ten minutes."""
    begun = Path(recording.source).parent.with_name("begun")
    begun.with_name("pid").write_text(str(os.getpid()))
    begun.with_name("pid").rename(begun)  # the content is complete when the file appears
    time.sleep(600)
    raise AssertionError


@pytest.mark.usefixtures("no_prognoses")
def test_a_signal_ends_a_hanging_diagnosis_which_is_repeated_at_the_next_start(
    arrived: Path, desk: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    (desk / "in").mkdir()
    shutil.copy(arrived / "SN-7_101.csv", desk / "in")
    line = ["watch", str(desk / "in"), *NAME, "--settle", "0", "--db", "h.sqlite", "--new-units"]
    with monkeypatch.context() as patched:
        patched.setattr(diagnosers, "search", hangs)
        soon = replace(WATCH, isolation=replace(WATCH.isolation, last_s=0.3))
        patched.setattr("emaphm.monitoring.WATCH", soon)
        for number, code in ((signal.SIGTERM, 0), (signal.SIGINT, 130)):
            check_that_it_ends(line, number, code)
    assert "Traceback" not in capfd.readouterr().err
    assert main([*line, "--once"]) == 0
    assert "1 recording diagnosed" in capfd.readouterr().err


def check_that_it_ends(line: list[str], number: int, code: int) -> None:
    """Send a signal during a diagnosis: no process and no partial file remains."""
    begun, sent = Path("begun"), list[float]()
    begun.unlink(missing_ok=True)
    with signal_once(number, begun.exists, lambda: sent.append(time.monotonic())):
        assert main(line) == code
        assert time.monotonic() - sent[0] < 10.0  # of 600
    wait_for(lambda: not Path(f"/proc/{begun.read_text()}").exists())
    with History.open("h.sqlite") as history:
        assert not history.units()


@pytest.mark.skipif(sys.platform == "win32", reason="needs a POSIX pipe")
def test_a_closed_pipe_ends_the_watch(
    desk: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    (desk / "in").mkdir()
    (desk / "in" / "nameless.csv").write_text("no recording")  # a refusal is an event
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as pipe:
        monkeypatch.setattr(sys, "stdout", pipe)
        assert main(["watch", "in", *NAME, "--settle", "0"]) == 0
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("none", "none: no such folder"),
        ("--foder", "unknown option: --foder"),
        ("good.csv", "is no folder"),
        (". --name {units}.csv", "did you mean 'unit'"),
        ("- --name {unit}.csv", "--name is a pattern of file names, which a stream does not have"),
        (". --webhook ftp://host", "--webhook"),
        (". --raise-after 0", "--raise-after 0"),
        (". --clear-after 99", "--clear-after 99"),
        (". --settle -1", "--settle -1"),
        (". --horizon 0", "horizon of 0"),
        (". --risk 2", "risk of 2"),
        (". --hours -4", "hours -4"),
        (". --healthy none.json", "none.json"),
        (". --actuator none.toml", "none.toml"),
        (". --db good.toml", "good.toml"),
        (". --db postgresql://127.0.0.1:1/x", "127.0.0.1"),
        (". --seed -1", "--seed -1"),
        (". --fast", "--estimator FILE"),
        (". --estimator good.csv", "no estimator"),
    ],
)
def test_input_that_cannot_be_watched_is_refused(refused: Refusal, line: str, said: str) -> None:
    assert said in refused("watch", *line.split())


def test_a_stream_from_a_closed_stdin_is_refused(refused: Refusal, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", None)
    assert "stdin is closed" in refused("watch", "-", "--unit", "S1", "--hours", "1")


def test_a_history_of_a_newer_version_is_refused(refused: Refusal, desk: Path) -> None:
    from emaphm.history.storage.schema import VERSION

    with History.open("h.sqlite", create=True) as history, history.database.writing() as connection:
        connection.execute(VERSION.update().values(version_num="9999"))
    (desk / "in").mkdir()
    assert "newer version of emaphm" in refused("watch", "in", "--db", "h.sqlite")


def test_files_with_schema_names_need_a_unit(desk: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (desk / "in").mkdir()
    (desk / "in" / "a.csv").write_bytes(files.csv(files.columns()))
    assert main(["watch", "in", "--once", "--settle", "0"]) == 0
    out, err = capfd.readouterr()
    (event,) = [json.loads(line) for line in out.splitlines()]
    assert "its unit is not known; give --unit" in event["message"]
    assert "watching in, a new history is created in history.sqlite" in err
    assert (
        main(["watch", "in", "--name", "{unit}_{hours}.csv", "--once", "--settle", "0", "--db", "2.sqlite"])
        == 0
    )
    (event,) = [json.loads(line) for line in capfd.readouterr().out.splitlines()]
    assert "matches --name {unit}_{hours}.csv, as this one does not" in event["message"]


@pytest.mark.usefixtures("no_prognoses")
def test_the_estimator_diagnoses_the_recordings_it_was_trained_for(
    tmp_path: Path, desk: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    setup = short_setup()
    estimator = constant_estimator(setup, setup.space.points(Faults(friction=0.3).vector), 0.02)
    estimator.save(tmp_path / "unit.estimator")
    (desk / "in").mkdir()
    for number, stop_hz in enumerate((40.0, 30.0)):  # the second is another manoeuvre
        command = replace(CHIRP, stop_hz=stop_hz)
        faults = Faults(friction=0.3)
        recording = simulate(THESIS, command, faults=faults, duration=0.1, sample_rate=2000.0, noise=0.05)
        columns = {name: recording[name] for name in ("time_s", "command_rad", "current_A", "voltage_V")}
        write_recording(Recording(columns), desk / "in" / f"U_{number}.csv")
    line = ["watch", "in", *NAME, "--once", "--settle", "0", "--db", "h.sqlite", "--new-units", "--whole"]
    assert main([*line, "--estimator", str(tmp_path / "unit.estimator"), "--fast"]) == 0
    assert "2 recordings diagnosed" in capfd.readouterr().err
    with History.open("h.sqlite") as history:
        diagnoses = [json.loads(one.text) for one in history.unit("U").diagnoses()]
    assert [one["method"].startswith("estimator") for one in diagnoses] == [True, False]
    assert any("the estimator was not used" in note for note in diagnoses[1]["notes"])
