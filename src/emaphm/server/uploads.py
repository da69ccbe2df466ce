"""Uploads: check of the form's fields, storage of the file in the server's folder, and a job in the queue."""

import math
import os
import shutil
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from starlette.datastructures import FormData, UploadFile
from starlette.formparsers import MultiPartException
from starlette.requests import ClientDisconnect, Request

from emaphm.errors import (
    EmaphmError,
    HistoryError,
    HistoryUnavailableError,
    RecordingError,
    ServerError,
    nearest,
)
from emaphm.history.records import Entry, whole_cycles
from emaphm.recording.io.read import READERS
from emaphm.server.folders import PARTIAL, ServerFolder, new_upload, on_disk
from emaphm.server.work.queue import Queue
from emaphm.server.work.statement import AS_BEFORE, check_statement, in_fields

if TYPE_CHECKING:
    from emaphm.history import History
    from emaphm.server.work.pool import Pool

MULTIPART = "multipart/form-data"

MOST_FIELDS = 20

STATED = ("unit", "hours", "cycles", "position", "part", "actuator", "late")
"""The fields that describe a recording."""

LONGEST_NAME = 100
"""Longest excerpt of a client's file name [characters]; it is never used as a path on this machine."""


class BusyError(EmaphmError):
    """The queue is full: no further upload is accepted."""


def status_of(error: Exception) -> int:
    """Return the status of an answer: 503 if the server cannot do it now, 422 if the request is wrong."""
    return 503 if isinstance(error, BusyError | HistoryError | ServerError) else 422


@dataclass(frozen=True)
class Uploads:
    """Receiver of uploads."""

    history: "History"
    folder: ServerFolder
    queue: Queue
    pool: "Pool"
    actuators: tuple[str, ...]
    most_waiting: int

    @asynccontextmanager
    async def form(self, request: Request) -> AsyncIterator[dict[str, Any]]:
        """Yield the fields of the form in a request.

        Raises
        ------
        RecordingError
            The form cannot be read, or has a field twice.
        ServerError
            The disk of the server is full.
        """
        if not request.headers.get("content-type", "").lower().startswith(MULTIPART):
            raise RecordingError(
                f"this is no form with a file; send {MULTIPART}, with the file as 'recording'"
            )
        try:
            form = await request.form(max_files=1, max_fields=MOST_FIELDS)
        except (MultiPartException, ClientDisconnect, ValueError):
            raise RecordingError(f"the form cannot be read; send {MULTIPART}") from None
        except OSError as error:  # a large file is buffered on disk while it is received
            raise _storage_error(error) from None
        try:
            yield _fields_of(form)
        finally:
            await form.close()

    def received(self, form: dict[str, Any]) -> int:
        """Store an upload and add a job for it; return the job's number. Both are on disk then.

        Raises
        ------
        EmaphmError
            A field is missing, wrong or contradicts the history.
        BusyError
            Too many uploads wait already.
        ServerError
            The disk is full; the upload may be sent again.
        """
        fields = dict(form)
        sent = fields.pop("recording", None)
        if not isinstance(sent, UploadFile) or not sent.filename or not sent.size:
            raise RecordingError("no recording was sent, or an empty one; choose a file, as 'recording'")
        _check_names(fields)
        details = request_of(fields, self.actuators)
        name = shown_name(sent.filename)
        ending = os.path.splitext(name)[1].lower()  # noqa: PTH122 - the name is no path
        if ending not in READERS:
            raise RecordingError(f"{name}: is no recording; it ends in {', '.join(READERS)}")
        self._check(details)
        if self.queue.waiting() >= self.most_waiting:
            raise BusyError(f"{self.most_waiting} uploads wait already; try again later")
        stored_name = new_upload(ending)
        path = self.folder.upload(stored_name)
        partial = path.with_name(f"{stored_name}{PARTIAL}")
        try:
            with partial.open("xb") as file:
                shutil.copyfileobj(sent.file, file, 2**20)
                file.flush()
                os.fsync(file.fileno())
            partial.rename(path)
            on_disk(self.folder.uploads)
            number = self.queue.add(details | {"name": name}, stored_name)
        except ServerError:
            path.unlink(missing_ok=True)
            raise
        except OSError as error:
            path.unlink(missing_ok=True)
            raise _storage_error(error) from None
        finally:
            partial.unlink(missing_ok=True)
        self.pool.wake()
        return number

    def _check(self, details: dict[str, Any]) -> None:
        """Refuse an upload that contradicts the history now, with the message of its job."""
        is_begun = self.queue.has_unit(details["unit"])  # before the history: a job may end in between
        try:
            check_statement(self.history, details, is_begun=is_begun)
        except HistoryUnavailableError:
            return  # the job waits until the history is available again
        except HistoryError as error:
            raise RecordingError(in_fields(str(error))) from None


def _storage_error(error: OSError) -> ServerError:
    return ServerError(f"the recording cannot be kept ({error.strerror or error}); free space on the server")


def _fields_of(form: FormData) -> dict[str, Any]:
    """Return the fields of a form by name; `RecordingError` if a field is given several times."""
    counts = Counter(name for name, _ in form.multi_items())
    for name, count in counts.items():
        if count > 1:
            raise RecordingError(f"{shown_name(name)}: is given {count} times; give it once")
    return dict(form)


def _check_names(fields: dict[str, Any]) -> None:
    for name in fields:
        if name not in STATED:
            printable = shown_name(name)
            raise RecordingError(f"unknown field '{printable}'{nearest(printable, STATED)}")


def request_of(form: dict[str, Any], actuators: tuple[str, ...]) -> dict[str, Any]:
    """Return the request in the fields of an upload; `EmaphmError` names the first field that is wrong."""
    given = {name: value.strip() for name, value in form.items() if isinstance(value, str)}
    actuator = given.get("actuator", AS_BEFORE)
    if actuator != AS_BEFORE and actuator not in actuators:
        raise RecordingError(f"unknown description '{shown_name(actuator)}'{nearest(actuator, actuators)}")
    if given.get("late", "") not in {"", "on", "true", "false"}:
        raise RecordingError("late: give true or false")
    part = given.get("part", "")
    try:
        entry = Entry(
            unit=given.get("unit", ""),
            part_number=part or "as described",
            hours=_number(given.get("hours", ""), "hours"),
            cycles=whole_cycles(given["cycles"]) if given.get("cycles") else None,
            position=given.get("position") or None,
            late=given.get("late") in {"on", "true"},
        )
    except HistoryError as error:  # an error of the fields, not of the database
        raise RecordingError(str(error)) from None
    return {
        "unit": entry.unit,
        "part": part,
        "hours": entry.hours,
        "cycles": entry.cycles,
        "position": entry.position,
        "late": entry.late,
        "actuator": actuator,
    }


def shown_name(name: str) -> str:
    """Return a client's file name for display: without folders, printable, at most `LONGEST_NAME` long."""
    last = name.replace("\\", "/").rsplit("/", 1)[-1]
    printable = "".join(c if c.isprintable() else "_" for c in last).strip() or "recording"
    return printable if len(printable) <= LONGEST_NAME else f"…{printable[-LONGEST_NAME + 1 :]}"


def _number(text: str, field: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise RecordingError(f"{field}: give a number, such as 1250")
    return value
