"""Cache of a function of one frozen object, by the object's identity."""

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import TypeVar

Value = TypeVar("Value")
Result = TypeVar("Result")

KEPT = 64
"""Number of objects whose results are kept; a diagnosis uses one description and a few variants of it."""


class _Identity:
    """An object that equals only itself: comparing descriptions field by field would take too long."""

    def __init__(self, value: object) -> None:
        self.value = value

    def __hash__(self) -> int:
        return id(self.value)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Identity) and self.value is other.value


def cached_by_identity(function: Callable[[Value], Result]) -> Callable[[Value], Result]:
    """Return `function` with its results for the `KEPT` objects used last.

    The objects must be frozen, and no caller may change a result.
    """

    @lru_cache(maxsize=KEPT)
    def of_identity(identity: _Identity) -> Result:
        return function(identity.value)  # type: ignore[arg-type]

    @wraps(function)
    def cached(value: Value) -> Result:
        return of_identity(_Identity(value))

    return cached
