"""Paths that the system does not let a user access are refused in one line, as names that are too long."""

import errno
import os
from pathlib import Path
from typing import Any

import pytest

from .conftest import Refusal

LONG = "a" * 300


@pytest.mark.parametrize(
    "arguments",
    [
        ("watch", LONG),
        ("watch", ".", "--db", LONG),
        ("serve", "--tokens", LONG, "--add-token", "alice"),
        ("serve", "--host", "0.0.0.0", "--tokens", LONG),  # noqa: S104 - it is refused
        ("serve", "--templates", LONG),
        ("fleet", "simulate", "-o", LONG),
    ],
)
def test_a_name_that_is_too_long_is_refused(refused: Refusal, arguments: tuple[str, ...]) -> None:
    assert "File name too long" in refused(*arguments)


@pytest.mark.parametrize(
    "arguments",
    [
        ("replay", "good.csv", "--actuator", "closed/a.toml"),
        ("diagnose", "closed/r.csv"),
        ("diagnose", "unlisted"),
        ("split", "good.csv", "-o", "closed"),
        ("segment", "good.csv", "-o", "closed"),
        ("calibrate", "closed/c.csv", "--free", "inertia", "-o", "c.toml"),
        ("study", "run", "thesis", "-o", "closed"),
        ("study", "report", "s", "-o", "unlisted"),
    ],
)
def test_a_path_without_permission_is_refused(
    refused: Refusal, arguments: tuple[str, ...], desk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The system's refusals are simulated, because they do not apply to the superuser."""
    stat, listdir = Path.stat, os.listdir

    def guarded(path: Path, **options: Any) -> os.stat_result:
        if "closed" in path.parts[:-1]:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return stat(path, **options)

    def listed(path: Any) -> list[str]:
        if Path(path).name == "unlisted":
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return listdir(path)

    for folder in ("closed", "unlisted"):
        (desk / folder).mkdir()
    monkeypatch.setattr(Path, "stat", guarded)
    monkeypatch.setattr(os, "listdir", listed)
    message = refused(*arguments)
    assert "(Permission denied)" in message
    assert "permissions" in message or "let this user read" in message
