"""The query of an address: names and values that are not known there are refused, as they select nothing."""

from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

from fastapi import Request
from fastapi.exceptions import RequestValidationError
from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from emaphm.errors import closest, nearest

LONGEST_NAME = 60
"""Characters of a client's name or value that are shown."""

MOST_SHOWN = 20
"""Names that are refused in one answer."""


NAME, VALUE = "query_name", "query_value"
"""Types of the entries of what is refused."""


@dataclass(frozen=True)
class OneOf:
    """In the annotation of a name in a query: its value is one of `known`, or empty; others are refused."""

    known: tuple[str, ...]

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Return how the value is checked."""
        return core_schema.no_info_after_validator_function(self._checked, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Return what `/openapi.json` says of the value."""
        return {**handler(schema), "enum": ["", *self.known]}

    def _checked(self, value: str) -> str:
        if value not in ("", *self.known):
            raise PydanticCustomError(VALUE, "{reason}", {"reason": _unknown(value, self.known)})
        return value


def check_value(name: str, value: str, known: Collection[str]) -> None:
    """Refuse a value that is not among `known` as `OneOf` does; none where there are no known ones.

    Raises
    ------
    RequestValidationError
        With the nearest one.
    """
    if value and known and value not in known:
        raise RequestValidationError([{"loc": ("query", name), "msg": _unknown(value, known), "type": VALUE}])


def in_words(entry: dict[str, Any]) -> str:
    """Return what is said of an entry of what is refused where its place is not shown."""
    return str(entry["msg"]) if entry["type"] == NAME else f"{entry['loc'][-1]}: {entry['msg']}"


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


def _unknown(value: str, known: Collection[str]) -> str:
    return f"unknown value '{value[:LONGEST_NAME]}'{nearest(value[:LONGEST_NAME], known)}"


def _entry(name: str, reason: str) -> dict[str, Any]:
    return {"loc": ("query", name[:LONGEST_NAME]), "msg": reason, "type": NAME}
