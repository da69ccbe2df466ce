"""A recording that kills the process that judges it, or hangs it, is tried twice in all, then set aside.

A signal that asks all processes to end, and what dies while the watching is to stop, do not count.
"""

import json
import math
import os
import signal
import threading
import time
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from emaphm.actuator import Actuator
from emaphm.diagnosis import Diagnosis
from emaphm.history import History
from emaphm.monitoring import Ownership, Watching, WatchTask, watch
from emaphm.monitoring.watch_state import TRIED, WatchState
from emaphm.recording import Recording
from waiting import wait_for

from . import stand_in
from .stand_in import PATTERN, QUICK, THESIS

pytestmark = pytest.mark.usefixtures("warm_workers")

FAST = replace(QUICK, folder=replace(QUICK.folder, poll_s=0.05, settle_s=0.0))
POISON = stand_in.name(1, 1)


def poisoned(recording: Recording, actuator: Actuator, *, seed: int) -> Diagnosis:
    """Die of one file, but count how often that was."""
    path = Path(recording.source)
    if path.name == POISON:
        with path.parent.with_name("tries").open("a") as file:
            file.write("x")
        os.kill(os.getpid(), signal.SIGKILL)
    return stand_in.diagnosed(recording, actuator, seed=seed)


@pytest.fixture
def inbox(tmp_path: Path, no_prognoses: None) -> Path:  # noqa: ARG001
    folder = tmp_path / "in"
    folder.mkdir()
    for number in range(3):
        (folder / stand_in.name(1, number)).write_text(stand_in.content(1, number))
    return folder


def once(
    inbox: Path, said: list[str], *, stop: threading.Event | None = None, **options: Any
) -> tuple[Watching, list[str]]:
    with History.open(inbox.with_name("history.sqlite"), create=True) as history:
        usual: dict[str, Any] = {"diagnose": poisoned, "isolated": True}
        task = WatchTask(
            inbox,
            Ownership(THESIS.name, pattern=PATTERN),
            "test",
            cut=None,
            takes_new_units=True,
            once=True,
            **usual | options,
        )
        done = watch(task, history, THESIS, settings=FAST, stop=stop, say=said.append)
        return done, [one.message for one in history.events(kinds=["refused"])]


def tries(inbox: Path) -> int:
    return len(inbox.with_name("tries").read_text())


def test_what_kills_its_process_is_set_aside_and_the_rest_goes_on(inbox: Path) -> None:
    said = list[str]()
    done, refused = once(inbox, said)
    assert (done.judged, done.refused) == (2, 1)
    assert [line for line in said if "tried once more" in line] == [
        f"{POISON}: its process was killed by SIGKILL; it is tried once more"
    ]
    (killed,) = refused
    assert f"{POISON}: its process was killed by SIGKILL, for the second time; it is set aside" in killed
    assert once(inbox, said)[0] == Watching()  # not tried at the next start
    assert tries(inbox) == 2
    (inbox / POISON).write_text(stand_in.content(1, 40))  # another content is another file
    assert once(inbox, said, diagnose=stand_in.diagnosed, isolated=False)[0].judged == 1


def test_the_count_outlasts_the_watcher(inbox: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = WatchState.finish_file

    def then_killed(self: WatchState, *values: object) -> None:
        real(self, *values)  # type: ignore[arg-type]
        if values[0].outcome == TRIED:  # type: ignore[attr-defined]
            raise KeyboardInterrupt

    said = list[str]()
    for number in (0, 2):
        (inbox / stand_in.name(1, number)).unlink()
    with monkeypatch.context() as patch:
        patch.setattr(WatchState, "finish_file", then_killed)
        with pytest.raises(KeyboardInterrupt):
            once(inbox, said)
    assert tries(inbox) == 1
    _, refused = once(inbox, said)
    assert (tries(inbox), len(refused)) == (2, 1)


def signalled(recording: Recording, actuator: Actuator, *, seed: int) -> Diagnosis:
    """Get the signals that come to a whole group of processes, amid the diagnosis."""
    for number in (signal.SIGINT, signal.SIGTERM):
        os.kill(os.getpid(), number)
    return stand_in.diagnosed(recording, actuator, seed=seed)


def test_a_signal_to_the_process_that_judges_is_left_to_the_watching(inbox: Path) -> None:
    said = list[str]()
    done, refused = once(inbox, said, diagnose=signalled)
    assert (done.judged, refused, said) == (3, [], [])


def killed_soon(recording: Recording, actuator: Actuator, *, seed: int) -> Diagnosis:
    """Die, but not before the watching is to stop."""
    home = Path(recording.source).parents[1]
    (home / "begun").touch()
    wait_for((home / "stopping").exists)
    return poisoned(recording, actuator, seed=seed)


def test_a_kill_while_the_watching_is_to_stop_does_not_count(inbox: Path) -> None:
    home, stop, said = inbox.parent, threading.Event(), list[str]()

    def stop_then_kill() -> None:
        wait_for((home / "begun").exists)
        stop.set()
        (home / "stopping").touch()

    for number in (0, 2):
        (inbox / stand_in.name(1, number)).unlink()
    thread = threading.Thread(target=stop_then_kill)
    thread.start()
    done, refused = once(inbox, said, stop=stop, diagnose=killed_soon)
    thread.join()
    assert (tries(inbox), done, refused, said) == (1, Watching(), [], [])
    once(inbox, said)
    assert tries(inbox) == 3  # both tries are left


# Streams

STREAM = [
    json.dumps({"hours": 2.0, "time_s": t, "command_rad": c, "current_A": 1e-4 * t}) + "\n"
    for t, c in (
        (k / 100, 5e-3 * math.sin(0.08 * math.pi * (k % 300 - 100)) if k % 300 in range(100, 200) else 0.0)
        for k in range(900)
    )
]
"""Three movements of 1 s, each behind 1 s of rest and before 1 s more."""


LONGEST_S = 1.0
"""Of a call, where the diagnosis hangs [s]; it starts its process too, on a machine that may be busy."""


def poisoned_at(home: str, hangs: bool, recording: Recording, actuator: Actuator, *, seed: int) -> Diagnosis:
    """Die of the second movement, or hang, and count how often that was."""
    if recording["current_A"].max() > 4e-4 and recording["current_A"].max() < 7e-4:
        with Path(home, "tries").open("a") as file:
            file.write("x")
        if hangs:
            time.sleep(600.0)
        os.kill(os.getpid(), signal.SIGKILL)
    return stand_in.diagnosed(recording, actuator, seed=seed)


def streamed(
    home: Path, *, hangs: bool = False, lines: list[str] = STREAM
) -> tuple[Watching, dict[str, list[str]]]:
    """Watch the lines on a pipe; return what was done and the messages of all events by kind."""
    out, into = os.pipe()

    def write() -> None:
        with os.fdopen(into, "w") as pipe, suppress(BrokenPipeError):
            pipe.writelines(lines)

    threading.Thread(target=write, daemon=True).start()
    settings = replace(FAST, isolation=replace(FAST.isolation, seconds=LONGEST_S if hangs else 60.0))
    with History.open(home / "history.sqlite", create=True) as history:
        task = WatchTask(
            out,
            Ownership(THESIS.name, "S1"),
            cut=None,
            diagnose=partial(poisoned_at, str(home), hangs),
            takes_new_units=True,
            isolated=True,
        )
        done = watch(task, history, THESIS, settings=settings)
        os.close(out)
        said: dict[str, list[str]] = {}
        for one in history.events():
            said.setdefault(one.kind, []).append(one.message)
    return done, said


@pytest.mark.usefixtures("inbox")
def test_a_movement_that_hangs_is_set_aside_and_the_others_are_judged(tmp_path: Path) -> None:
    done, said = streamed(tmp_path, hangs=True)
    assert (done.judged, done.refused) == (2, 1)
    (message,) = said["refused"]
    assert message.startswith("S1 at 2 h, 3.")
    assert f"it took longer than {LONGEST_S:g} s, for the second time; it is set aside" in message
    assert streamed(tmp_path)[0] == Watching(rows_left_out=len(STREAM))  # all are judged already
    assert len((tmp_path / "tries").read_text()) == 2


@pytest.mark.usefixtures("inbox")
def test_the_count_of_a_movement_outlasts_the_watcher(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = WatchState.finish_file

    def then_killed(self: WatchState, *values: object) -> None:
        real(self, *values)  # type: ignore[arg-type]
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(WatchState, "finish_file", then_killed)
        with pytest.raises(KeyboardInterrupt):
            streamed(tmp_path)
    assert len((tmp_path / "tries").read_text()) == 1
    done, said = streamed(tmp_path, lines=STREAM[350:])  # sent again from the middle of a rest
    assert (done.judged, len(said["refused"])) == (1, 1)
    assert len((tmp_path / "tries").read_text()) == 2


@pytest.mark.usefixtures("inbox")
def test_a_movement_that_was_set_aside_and_is_sent_again_is_not_tried_again(tmp_path: Path) -> None:
    done, said = streamed(tmp_path, lines=STREAM + STREAM)  # as of a sender that connects again
    assert len((tmp_path / "tries").read_text()) == 2
    assert (done.judged, done.known) == (2, 2)
    (message,) = said["refused"]
    assert message.startswith("S1 at 2 h, 3.")
    assert "its process was killed by SIGKILL, for the second time; it is set aside" in message
    assert "of a movement that is set aside" in said["rows_skipped"][-1]
