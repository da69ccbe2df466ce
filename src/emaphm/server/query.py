"""The query of an address: a name that is not known there is refused, as it would select nothing."""

from collections import Counter
from typing import Any

from fastapi import Request
from fastapi.exceptions import RequestValidationError

from emaphm.errors import closest

LONGEST_NAME = 60
"""Characters of a client's name that are shown."""

MOST_SHOWN = 20
"""Names that are refused in one answer."""


async def check_query(request: Request) -> None:
    """Refuse a query with a name that the route does not have, or has once and was given several times.

    A dependency of the application, and so of every route.

    Raises
    ------
    RequestValidationError
        An entry for each such name, as for a value that is wrong.
    """
    known = [one.alias for one in request.scope["route"].dependant.query_params]
    counts = Counter(name for name, _ in request.query_params.multi_items())
    wrong = [
        _entry(name, reason) for name, count in counts.items() if (reason := _reason(name, count, known))
    ]
    if wrong:
        raise RequestValidationError(wrong[:MOST_SHOWN])


def _reason(name: str, count: int, known: list[str]) -> str:
    """Return why a name cannot be used, empty where it can."""
    if name in known:
        return "" if count == 1 else f"'{name}' is given {count} times; give it once"
    if not known:
        return f"unknown name '{name[:LONGEST_NAME]}'; this address has no query, leave it out"
    near = closest(name, known)
    hint = f" (did you mean '{near}'?)" if near else ""
    return f"unknown name '{name[:LONGEST_NAME]}'{hint}; known: {', '.join(known)}"


def _entry(name: str, reason: str) -> dict[str, Any]:
    return {"loc": ("query", name[:LONGEST_NAME]), "msg": reason, "type": "query_name"}
