"""Paths that the system does not let a user access are refused in one line, as names that are too long."""

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
