"""Fixtures that run a command line and return its exit code, stdout and stderr."""

import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from emaphm.cli import main
from history.unsynced import unsynced

from . import files
from .documented import undocumented

Refusal = Callable[..., str]

GOOD = files.csv(files.columns())


class Answer(NamedTuple):
    """Exit code, stdout and stderr of a command."""

    code: int
    out: str
    err: str


Emaphm = Callable[..., Answer]


@pytest.fixture(scope="module", autouse=True)
def _unsynced() -> Iterator[None]:
    with unsynced():
        yield


@pytest.fixture
def emaphm(capsys: pytest.CaptureFixture[str]) -> Emaphm:
    """Return a function that runs a command line here and compares its JSON keys with the reference."""

    def run(*arguments: str | Path) -> Answer:
        capsys.readouterr()
        code = main([str(argument) for argument in arguments])
        answer = Answer(code, *capsys.readouterr())
        if code == 0 and "--json" in arguments:
            for line in answer.out.splitlines():
                assert undocumented(arguments, json.loads(line)) == []
        return answer

    return run


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the current folder: it holds the recording `good.csv` and the description `good.toml`."""
    (tmp_path / "good.csv").write_bytes(GOOD)
    (tmp_path / "good.toml").write_text(files.THESIS, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def refused(emaphm: Emaphm, desk: Path) -> Refusal:
    """Return a function that runs a command, checks that it is refused, and returns the message.

    Checked: exit code 2, one line on stderr, empty stdout, and no file created, changed or removed.
    """

    def run(*arguments: str | Path) -> str:
        contents_before = dict(_contents(desk))
        code, out, err = emaphm(*arguments)
        assert (code, out) == (2, "")
        assert err.startswith("emaphm: ")
        assert err.endswith("\n")
        assert len(err.splitlines()) == 1
        assert dict(_contents(desk)) == contents_before
        return err

    return run


def _contents(folder: Path) -> Iterator[tuple[str, Any]]:
    for path in sorted(folder.rglob("*")):
        yield str(path), path.read_bytes() if path.is_file() else None


@pytest.fixture
def emps_file() -> Path:
    """Return the path of the measured EMPS data; tests that need it are skipped if it is missing."""
    beside = Path(__file__).resolve().parents[3] / "shared" / "data"
    path = Path(os.environ.get("EMAPHM_DATA", beside)) / "emps" / "DATA_EMPS.mat"
    if not path.is_file():
        pytest.skip(f"the EMPS data are not at {path}; set EMAPHM_DATA to the folder that holds them")
    return path
