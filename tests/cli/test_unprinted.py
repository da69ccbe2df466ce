"""An answer that cannot be printed: the requested files are written nevertheless.

Cases: the reader closes a pipe early (`emaphm … | head`), or the device is full.
"""

import os
import shutil
import sqlite3
import sys
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from emaphm.cli import main

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs a POSIX pipe")

QUICK = "--model averaged --nuisance none --no-correction"


@pytest.fixture
def plain(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw empty figures: other tests check their content, and drawing takes a second."""
    monkeypatch.setattr("emaphm.report.write.svg", lambda _: b"<svg/>")
    for drawer in ("replay.draw_replay", "design.draw_design"):
        monkeypatch.setattr(f"emaphm.plotting.{drawer}", lambda *_: Figure())


@pytest.fixture
def unread(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], None]]:
    """Return a function that replaces a stream by a pipe without a reader; each line fails at once."""
    pipes = []

    def make(name: str) -> None:
        reading, writing = os.pipe()
        os.close(reading)
        pipes.append(os.fdopen(writing, "w", buffering=1))
        monkeypatch.setattr(sys, name, pipes[-1])

    yield make
    for pipe in pipes:
        pipe.close()


@pytest.mark.usefixtures("plain")
@pytest.mark.parametrize("way", ["", " --json"])
@pytest.mark.parametrize(
    ("line", "names"),
    [
        ("simulate out.csv --model averaged --duration 0.1", ["out.csv"]),
        (f"diagnose good.csv {QUICK} --report out.html", ["out.html"]),
        ("replay good.csv --series out.csv --figure out.svg", ["out.csv", "out.svg"]),
        ("design --candidates 0 --tests 0 -o out.csv --figure out.svg", ["out.csv", "out.svg"]),
        ("init --from dc -o out.toml", ["out.toml"]),
    ],
)
def test_requested_files_are_written_without_a_reader(
    desk: Path,
    unread: Callable[[str], None],
    line: str,
    names: list[str],
    way: str,
) -> None:
    unread("stdout")
    assert main((line + way).split()) == 0
    assert [name for name in names if not (desk / name).stat().st_size] == []


FULL = Path("/dev/full")


@pytest.fixture
def full(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[], None]]:
    """Replace stdout by a full device; each line fails at once."""
    if not FULL.exists():
        pytest.skip("needs a device that is always full")
    with FULL.open("w", buffering=1, encoding="utf-8") as file:
        yield lambda: monkeypatch.setattr(sys, "stdout", file)


@pytest.mark.usefixtures("plain")
@pytest.mark.parametrize(
    ("line", "names"),
    [
        (f"diagnose good.csv {QUICK} --report out.html", ["out.html"]),
        ("replay good.csv --series out.csv --figure out.png", ["out.csv", "out.png"]),
        (f"diagnose good.csv {QUICK} --workers 1 --json -o kept", ["kept/results.sqlite"]),
        ("doctor", []),
        ("diagnose --help", []),
    ],
)
def test_a_full_device_costs_only_the_answer(
    desk: Path,
    full: Callable[[], None],
    capsys: pytest.CaptureFixture[str],
    line: str,
    names: list[str],
) -> None:
    full()
    assert main(line.split()) == 2
    messages = capsys.readouterr().err
    assert messages == "emaphm: stdout cannot be written: no space is left for it; write elsewhere\n"
    assert [name for name in names if not (desk / name).stat().st_size] == []


def test_a_full_device_does_not_hide_another_error(
    desk: Path, full: Callable[[], None], capsys: pytest.CaptureFixture[str]
) -> None:
    assert desk.is_dir()
    full()
    assert main(["diagnose", "absent.csv"]) == 2
    assert "absent.csv" in capsys.readouterr().err


def test_a_batch_continues_if_a_folder_stores_its_results(desk: Path, unread: Callable[[str], None]) -> None:
    shutil.copy("good.csv", "other.csv")
    unread("stdout")
    assert main(f"diagnose good.csv other.csv {QUICK} --workers 1 --json -o kept".split()) == 0
    with closing(sqlite3.connect(desk / "kept" / "results.sqlite")) as store:
        assert store.execute("SELECT count(*) FROM results").fetchone() == (2,)


def test_a_failure_is_reported_without_a_reader(desk: Path, unread: Callable[[str], None]) -> None:
    assert desk.is_dir()
    unread("stdout")
    assert main(["diagnose", "absent.csv", "none.csv", "--workers", "1"]) == 2


def test_progress_messages_need_no_reader(
    desk: Path, unread: Callable[[str], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    # Otherwise `emaphm train … 2>&1 | head -1` would end hours of work.
    with (desk / "answers").open("w", encoding="utf-8") as answers:
        answers.write("\n" * 20)
    with (desk / "answers").open(encoding="utf-8") as answers:
        monkeypatch.setattr(sys, "stdin", answers)
        unread("stderr")
        assert main(["init", "-o", "out.toml"]) == 0
    assert (desk / "out.toml").is_file()


def test_another_broken_pipe_is_not_taken_for_that_of_stdout(
    desk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object, **__: object) -> None:
        raise BrokenPipeError

    assert desk.is_dir()
    monkeypatch.setattr("emaphm.recording.read_recording", broken)  # for example to a worker that died
    with pytest.raises(BrokenPipeError):
        main(["replay", "good.csv"])
