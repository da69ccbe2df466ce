"""Check of the query of an address: unknown names and values are refused, since they would select nothing."""

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
"""Longest excerpt of a client's name or value in an error [characters]."""

MOST_REFUSED = 20
"""Largest number of names that one answer refuses."""


NAME, VALUE = "query_name", "query_value"
"""Types of the entries in a refusal."""


@dataclass(frozen=True)
class OneOf:
    """Annotation of a name in a query: its value must be one of `known`, or empty."""

    known: tuple[str, ...]

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Return the schema that checks the value."""
        return core_schema.no_info_after_validator_function(self._checked, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Return the schema of the value in `/openapi.json`."""
        return {**handler(schema), "enum": ["", *self.known]}

    def _checked(self, value: str) -> str:
        if value not in ("", *self.known):
            raise PydanticCustomError(VALUE, "{reason}", {"reason": _unknown(value, self.known)})
        return value


def check_value(name: str, value: str, known: Collection[str]) -> None:
    """Refuse a value that is not among `known`, as `OneOf` does; without known values, any value is accepted.

    Raises
    ------
    RequestValidationError
        The value is unknown; the message names the nearest known value.
    """
    if value and known and value not in known:
        raise RequestValidationError([{"loc": ("query", name), "msg": _unknown(value, known), "type": VALUE}])


def in_words(entry: dict[str, Any]) -> str:
    """Return the message of an entry in a refusal, with the name of the value."""
    return str(entry["msg"]) if entry["type"] == NAME else f"{entry['loc'][-1]}: {entry['msg']}"


async def check_query(request: Request) -> None:
    """Refuse a query with a name that the route does not have, or that is given several times.

    It is a dependency of the application, and therefore of every route.

    Raises
    ------
    RequestValidationError
        There is such a name; the error has an entry for each.
    """
    known = [parameter.alias for parameter in request.scope["route"].dependant.query_params]
    counts = Counter(name for name, _ in request.query_params.multi_items())
    wrong = [
        _entry(name, reason) for name, count in counts.items() if (reason := _reason(name, count, known))
    ]
    if wrong:
        raise RequestValidationError(wrong[:MOST_REFUSED])


def _reason(name: str, count: int, known: list[str]) -> str:
    """Return the reason why a name cannot be used, empty if it can."""
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
