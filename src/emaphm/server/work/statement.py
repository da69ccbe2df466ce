"""Check of the fields of an upload against the history, when it is sent and when it is diagnosed."""

import re
from typing import TYPE_CHECKING, Any

from emaphm.errors import HistoryError, HistoryUnavailableError
from emaphm.history.reading import unit_or_none
from emaphm.history.records import Entry
from emaphm.history.unit import Unit

if TYPE_CHECKING:
    from emaphm.history import History

AS_BEFORE = ""
"""Value of the field "actuator" for the description of the unit's last diagnosis."""

OPTION = re.compile(r"--([a-z]+)")
"""Pattern of an option of the command line in a message; the field of an upload has the same name."""


def known_unit(history: "History", request: dict[str, Any]) -> Unit | None:
    """Return the unit of an upload, None if it is new and has one of the server's descriptions.

    Raises
    ------
    HistoryError
        The unit is unknown, and no description is named.
    """
    with history.database.reading() as connection:
        row = unit_or_none(connection, request["unit"])
    if row is not None:
        return Unit(history.database, row)
    if request["actuator"] == AS_BEFORE:
        try:
            history.unit(request["unit"])
        except HistoryUnavailableError:
            raise
        except HistoryError as error:
            raise HistoryError(f"{error}; correct it, or choose a description to add a new unit") from None
    return None


def entry_of(request: dict[str, Any], part_number: str) -> Entry:
    """Return the entry of an upload, with `part_number` if its fields give none."""
    return Entry(
        request["unit"],
        request["part"] or part_number,
        request["hours"],
        request["cycles"],
        request["position"],
        request["late"],
    )


def check_statement(history: "History", request: dict[str, Any], *, is_begun: bool) -> None:
    """Refuse an upload whose fields contradict the history, independently of its recording.

    Parameters
    ----------
    history
        History of all units.
    request
        Fields of the upload.
    is_begun
        Whether a waiting upload may add the unit.

    Raises
    ------
    HistoryError
        The same as for its job; `HistoryUnavailableError` if the history is not available.
    """
    try:
        unit = known_unit(history, request)
    except HistoryUnavailableError:
        raise
    except HistoryError:
        if is_begun:
            return
        raise
    if unit is not None:
        history.check(entry_of(request, unit.part_number))


def in_fields(message: str) -> str:
    """Return a message with options of the command line replaced by the fields of an upload."""
    return OPTION.sub(r"'\1'", message)
