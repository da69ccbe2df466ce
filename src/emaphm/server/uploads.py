"""An upload: its fields checked, its file put into the server's folder, and a job of it in the queue."""

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
"""The fields that say something of a recording."""

LONGEST_NAME = 100
"""Characters of a file's name that are shown; it names nothing on this machine."""


class BusyError(EmaphmError):
    """The queue is full: no further upload is taken."""


def status_of(error: Exception) -> int:
    """Return the status of an answer: whether what was asked is wrong, or the server cannot do it now."""
    return 503 if isinstance(error, BusyError | HistoryError | ServerError) else 422


@dataclass(frozen=True)
class Uploads:
    """Where uploads go."""

    history: "History"
    folder: ServerFolder
    queue: Queue
    pool: "Pool"
    actuators: tuple[str, ...]
    most_waiting: int

    @asynccontextmanager
    async def form(self, request: Request) -> AsyncIterator[dict[str, Any]]:
        """Yield the fields of a form that is sent.

        Raises
        ------
        RecordingError
            It cannot be read, or has a field twice.
        ServerError
            This machine cannot hold it, as its disk is full.
        """
        if not request.headers.get("content-type", "").lower().startswith(MULTIPART):
            raise RecordingError(
                f"this is no form with a file; send {MULTIPART}, with the file as 'recording'"
            )
        try:
            found = await request.form(max_files=1, max_fields=MOST_FIELDS)
        except (MultiPartException, ClientDisconnect, ValueError):
            raise RecordingError(f"the form cannot be read; send {MULTIPART}") from None
        except OSError as error:  # a file of some size is on disk while it arrives
            raise _not_kept(error) from None
        try:
            yield _each_once(found)
        finally:
            await found.close()

    def received(self, form: dict[str, Any]) -> int:
        """Return the number of the job that an upload has become; it is on disk then.

        Raises
        ------
        EmaphmError
            A field is missing, wrong or contradicts the history.
        BusyError
            Too many wait already.
        ServerError
            It cannot be kept, as the disk is full; it may be sent again.
        """
        fields = dict(form)
        sent = fields.pop("recording", None)
        if not isinstance(sent, UploadFile) or not sent.filename or not sent.size:
            raise RecordingError("no recording was sent, or an empty one; choose a file, as 'recording'")
        _check_names(fields)
        details = request_of(fields, self.actuators)
        name = shown_name(sent.filename)
        ending = os.path.splitext(name)[1].lower()  # noqa: PTH122 - of no file
        if ending not in READERS:
            raise RecordingError(f"{name}: is no recording; it ends in {', '.join(READERS)}")
        self._check(details)
        if self.queue.waiting() >= self.most_waiting:
            raise BusyError(f"{self.most_waiting} uploads wait already; try again later")
        kept = new_upload(ending)
        path = self.folder.upload(kept)
        partial = path.with_name(f"{kept}{PARTIAL}")
        try:
            with partial.open("xb") as file:
                shutil.copyfileobj(sent.file, file, 2**20)
                file.flush()
                os.fsync(file.fileno())
            partial.rename(path)
            on_disk(self.folder.uploads)
            number = self.queue.add(details | {"name": name}, kept)
        except ServerError:
            path.unlink(missing_ok=True)
            raise
        except OSError as error:
            path.unlink(missing_ok=True)
            raise _not_kept(error) from None
        finally:
            partial.unlink(missing_ok=True)
        self.pool.wake()
        return number

    def _check(self, details: dict[str, Any]) -> None:
        """Refuse what the history contradicts already, with what the job would say."""
        is_begun = self.queue.has_unit(details["unit"])  # first: what was waiting is in the history then
        try:
            check_statement(self.history, details, is_begun=is_begun)
        except HistoryUnavailableError:
            return  # the job waits until it is back
        except HistoryError as error:
            raise RecordingError(in_fields(str(error))) from None


def _not_kept(error: OSError) -> ServerError:
    return ServerError(f"the recording cannot be kept ({error.strerror or error}); free space on the server")


def _each_once(form: FormData) -> dict[str, Any]:
    counts = Counter(name for name, _ in form.multi_items())
    for name, count in counts.items():
        if count > 1:
            raise RecordingError(f"{shown_name(name)}: is given {count} times; give it once")
    return dict(form)


def _check_names(fields: dict[str, Any]) -> None:
    for name in fields:
        if name not in STATED:
            shown = shown_name(name)
            raise RecordingError(f"unknown field '{shown}'{nearest(shown, STATED)}")


def request_of(form: dict[str, Any], actuators: tuple[str, ...]) -> dict[str, Any]:
    """Return what the fields of an upload say; `EmaphmError` names the first that is wrong."""
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
    except HistoryError as error:  # of what was sent, not of the database
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
    """Return a client's name as it is shown: no folder, nothing that is not printable, not too long."""
    last = name.replace("\\", "/").rsplit("/", 1)[-1]
    shown = "".join(c if c.isprintable() else "_" for c in last).strip() or "recording"
    return shown if len(shown) <= LONGEST_NAME else f"…{shown[-LONGEST_NAME + 1 :]}"


def _number(text: str, what: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise RecordingError(f"{what}: give a number, such as 1250")
    return value
