"""A recording that kills the process that judges it is tried twice in all, then set aside."""

import os
import signal
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from emaphm.actuator import Actuator
from emaphm.diagnosis import Diagnosis
from emaphm.history import History
from emaphm.history.watching import TRIED, WatchState
from emaphm.monitoring import Ownership, Task, Watching, watch
from emaphm.monitoring.outlook import Outlook
from emaphm.recording import Recording

from . import stand_in
from .stand_in import PATTERN, QUICK, THESIS

FAST = replace(QUICK, folder=replace(QUICK.folder, poll_s=0.05, settle_s=0.1))
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
def inbox(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(Outlook, "ask", lambda *_: None)
    folder = tmp_path / "in"
    folder.mkdir()
    for number in range(3):
        (folder / stand_in.name(1, number)).write_text(stand_in.content(1, number))
    return folder


def once(inbox: Path, said: list[str], **options: Any) -> tuple[Watching, list[str]]:
    with History.open(inbox.with_name("history.sqlite"), create=True) as history:
        usual: dict[str, Any] = {"diagnose": poisoned, "isolated": True}
        task = Task(
            inbox,
            Ownership(THESIS.name, pattern=PATTERN),
            "test",
            cut=None,
            takes_new_units=True,
            once=True,
            **usual | options,
        )
        done = watch(task, history, THESIS, settings=FAST, say=said.append)
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
