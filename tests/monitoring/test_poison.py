"""A recording that kills or blocks the process that judges it is tried twice, then set aside.

Signals to the whole process group, and processes killed while the watcher stops, do not count as tries.
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
    """Kill the process for the file `POISON`, after noting the try; diagnose other files."""
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


def watch_once(
    inbox: Path, messages: list[str], *, stop: threading.Event | None = None, **options: Any
) -> tuple[Watching, list[str]]:
    with History.open(inbox.with_name("history.sqlite"), create=True) as history:
        defaults: dict[str, Any] = {"diagnose": poisoned, "isolated": True}
        task = WatchTask(
            inbox,
            Ownership(THESIS.name, pattern=PATTERN),
            "test",
            cut=None,
            takes_new_units=True,
            once=True,
            **defaults | options,
        )
        result = watch(task, history, THESIS, settings=FAST, stop=stop, say=messages.append)
        return result, [event.message for event in history.events(kinds=["refused"])]


def count_tries(inbox: Path) -> int:
    return len(inbox.with_name("tries").read_text())


def test_a_file_that_kills_its_process_twice_is_set_aside_and_other_files_are_judged(inbox: Path) -> None:
    messages = list[str]()
    result, refused = watch_once(inbox, messages)
    assert (result.judged, result.refused) == (2, 1)
    assert [line for line in messages if "tried once more" in line] == [
        f"{POISON}: its process was killed by SIGKILL; it is tried once more"
    ]
    (killed,) = refused
    assert f"{POISON}: its process was killed by SIGKILL, for the second time; it is set aside" in killed
    assert watch_once(inbox, messages)[0] == Watching()  # not tried at the next start
    assert count_tries(inbox) == 2
    (inbox / POISON).write_text(stand_in.content(1, 40))  # a changed file counts as a new file
    assert watch_once(inbox, messages, diagnose=stand_in.diagnosed, isolated=False)[0].judged == 1


def test_the_number_of_tries_of_a_file_survives_the_watcher(
    inbox: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = WatchState.finish_file

    def then_killed(self: WatchState, *values: object) -> None:
        real(self, *values)  # type: ignore[arg-type]
        if values[0].outcome == TRIED:  # type: ignore[attr-defined]
            raise KeyboardInterrupt

    messages = list[str]()
    for number in (0, 2):
        (inbox / stand_in.name(1, number)).unlink()
    with monkeypatch.context() as patch:
        patch.setattr(WatchState, "finish_file", then_killed)
        with pytest.raises(KeyboardInterrupt):
            watch_once(inbox, messages)
    assert count_tries(inbox) == 1
    _, refused = watch_once(inbox, messages)
    assert (count_tries(inbox), len(refused)) == (2, 1)


def signalled(recording: Recording, actuator: Actuator, *, seed: int) -> Diagnosis:
    """Send the signals of a process group to this process during the diagnosis."""
    for number in (signal.SIGINT, signal.SIGTERM):
        os.kill(os.getpid(), number)
    return stand_in.diagnosed(recording, actuator, seed=seed)


def test_a_judging_process_ignores_signals_to_its_process_group(inbox: Path) -> None:
    messages = list[str]()
    result, refused = watch_once(inbox, messages, diagnose=signalled)
    assert (result.judged, refused, messages) == (3, [], [])


def killed_soon(recording: Recording, actuator: Actuator, *, seed: int) -> Diagnosis:
    """Kill the process after the watcher was asked to stop."""
    home = Path(recording.source).parents[1]
    (home / "begun").touch()
    wait_for((home / "stopping").exists)
    return poisoned(recording, actuator, seed=seed)


def test_a_kill_while_the_watcher_stops_does_not_count_as_a_try(inbox: Path) -> None:
    home, stop, messages = inbox.parent, threading.Event(), list[str]()

    def stop_then_kill() -> None:
        wait_for((home / "begun").exists)
        stop.set()
        (home / "stopping").touch()

    for number in (0, 2):
        (inbox / stand_in.name(1, number)).unlink()
    thread = threading.Thread(target=stop_then_kill)
    thread.start()
    result, refused = watch_once(inbox, messages, stop=stop, diagnose=killed_soon)
    thread.join()
    assert (count_tries(inbox), result, refused, messages) == (1, Watching(), [], [])
    watch_once(inbox, messages)
    assert count_tries(inbox) == 3  # the killed try did not count, so two more tries are made


# Streams

STREAM = [
    json.dumps({"hours": 2.0, "time_s": t, "command_rad": c, "current_A": 1e-4 * t}) + "\n"
    for t, c in (
        (k / 100, 5e-3 * math.sin(0.08 * math.pi * (k % 300 - 100)) if k % 300 in range(100, 200) else 0.0)
        for k in range(900)
    )
]
"""Three movements of 1 s, each with 1 s of rest before and after."""


LONGEST_S = 1.0
"""Time limit of a diagnosis that hangs [s], with the start of its process on a machine that may be busy."""


def poisoned_at(home: str, hangs: bool, recording: Recording, actuator: Actuator, *, seed: int) -> Diagnosis:
    """Kill or block the process for the second movement, after noting the try; diagnose other movements."""
    if recording["current_A"].max() > 4e-4 and recording["current_A"].max() < 7e-4:
        with Path(home, "tries").open("a") as file:
            file.write("x")
        if hangs:
            time.sleep(600.0)
        os.kill(os.getpid(), signal.SIGKILL)
    return stand_in.diagnosed(recording, actuator, seed=seed)


def watch_stream(
    home: Path, *, hangs: bool = False, lines: list[str] = STREAM
) -> tuple[Watching, dict[str, list[str]]]:
    """Watch the lines on a pipe; return the result and the messages of all events by kind."""
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
        result = watch(task, history, THESIS, settings=settings)
        os.close(out)
        messages: dict[str, list[str]] = {}
        for event in history.events():
            messages.setdefault(event.kind, []).append(event.message)
    return result, messages


@pytest.mark.usefixtures("inbox")
def test_a_movement_that_hangs_twice_is_set_aside_and_the_others_are_judged(tmp_path: Path) -> None:
    result, messages = watch_stream(tmp_path, hangs=True)
    assert (result.judged, result.refused) == (2, 1)
    (message,) = messages["refused"]
    assert message.startswith("S1 at 2 h, 3.")
    assert f"it took longer than {LONGEST_S:g} s, for the second time; it is set aside" in message
    assert watch_stream(tmp_path)[0] == Watching(rows_left_out=len(STREAM))  # all are judged already
    assert len((tmp_path / "tries").read_text()) == 2


@pytest.mark.usefixtures("inbox")
def test_the_number_of_tries_of_a_movement_survives_the_watcher(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = WatchState.finish_file

    def then_killed(self: WatchState, *values: object) -> None:
        real(self, *values)  # type: ignore[arg-type]
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(WatchState, "finish_file", then_killed)
        with pytest.raises(KeyboardInterrupt):
            watch_stream(tmp_path)
    assert len((tmp_path / "tries").read_text()) == 1
    result, messages = watch_stream(tmp_path, lines=STREAM[350:])  # sent again from the middle of a rest
    assert (result.judged, len(messages["refused"])) == (1, 1)
    assert len((tmp_path / "tries").read_text()) == 2


@pytest.mark.usefixtures("inbox")
def test_a_movement_set_aside_and_sent_again_is_not_tried_again(tmp_path: Path) -> None:
    result, messages = watch_stream(tmp_path, lines=STREAM + STREAM)  # as from a sender that connects again
    assert len((tmp_path / "tries").read_text()) == 2
    assert (result.judged, result.known) == (2, 2)
    (message,) = messages["refused"]
    assert message.startswith("S1 at 2 h, 3.")
    assert "its process was killed by SIGKILL, for the second time; it is set aside" in message
    assert "of a movement that is set aside" in messages["rows_skipped"][-1]
