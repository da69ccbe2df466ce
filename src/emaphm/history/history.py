"""History of the units of a fleet."""

from collections.abc import Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from emaphm.errors import HistoryError, nearest
from emaphm.history import reading, writing
from emaphm.history.basis import Basis, bases
from emaphm.history.events import Event, add_events, read_events, read_open_conditions
from emaphm.history.fingerprint import description_of
from emaphm.history.kept_diagnosis import KeptDiagnosis, KeptSettings
from emaphm.history.kept_prognosis import KeptPrognosis, keep_prognosis, read_prognoses
from emaphm.history.records import Entry, Finding, Mistake, Removal, Withdrawal
from emaphm.history.storage.address import Address
from emaphm.history.storage.database import Database
from emaphm.history.storage.schema import bring_up_to_date, check_revision
from emaphm.history.storage.tables import UNITS
from emaphm.history.unit import Unit
from emaphm.history.views import UnitState, states
from emaphm.history.withdrawing import withdraw
from emaphm.recording.content import recording_hash

if TYPE_CHECKING:
    from collections.abc import Iterator

    import sqlalchemy as sa

    from emaphm.actuator import Actuator
    from emaphm.diagnosis import Diagnosis
    from emaphm.recording import Recording


@dataclass(frozen=True)
class Added:
    """Result of adding a diagnosis: whether it was `added` or already existed; its recording's SHA-256."""

    added: bool
    recording_hash: str


@dataclass(frozen=True, eq=False)
class History:
    """Units, flights, recordings, diagnoses, removals and shop findings, in a SQLite file or on PostgreSQL.

    Close it, or use it in a ``with`` statement. When a method that writes returns, its changes are on disk.
    Any number of processes may read and write. Each method raises `HistoryError` if the database fails.

    >>> with History.open("fleet.sqlite") as history:                                       # doctest: +SKIP
    ...     for diagnosis in history.unit("SN-0042").diagnoses():
    ...         print(diagnosis.hours, diagnosis.vector, diagnosis.explained)
    """

    database: Database

    @classmethod
    def open(cls, where: str | Path, *, create: bool = False) -> Self:
        """Return the history at `where`; an older schema of the database is upgraded.

        Parameters
        ----------
        where
            A file, or postgresql://USER@HOST:PORT/DATABASE.
        create
            Whether to create a missing history.

        Raises
        ------
        HistoryError
            There is no history, the database cannot be reached within ten seconds, it is not a history, or it
            has a schema of a newer version.
        """
        database = Database.open(Address.of(where), create=create)
        try:
            bring_up_to_date(database, create=create)
        except BaseException:
            database.close()
            raise
        return cls(database)

    def close(self) -> None:
        """Close the database."""
        self.database.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @contextmanager
    def writing(self) -> "Iterator[sa.Connection]":
        """Yield a connection with the exclusive right to write; commit its transaction if the body ends.

        Raises
        ------
        HistoryError
            The database fails, or a newer version of emaphm has changed the history since it was opened.
        """
        with self.database.writing() as connection:
            check_revision(connection, self.database.address.shown)
            yield connection

    def units(self, part_number: str | None = None) -> tuple[Unit, ...]:
        """Return all units, or those of a part number, by part and serial number."""
        with self.database.reading() as connection:
            rows = reading.units(connection)
        return tuple(Unit(self.database, row) for row in rows if part_number in (None, row.part_number))

    def check_part_number(self, part_number: str | None) -> None:
        """Refuse a part number that no unit has, `HistoryError` with the nearest one; None is accepted."""
        with self.database.reading() as connection:
            known = {row.part_number for row in reading.units(connection)}
        # An empty history has no unit of any part number.
        if part_number is not None and known and part_number not in known:
            raise HistoryError(f"no units of the part number '{part_number}'{nearest(part_number, known)}")

    def unit(self, serial_number: str) -> Unit:
        """Return a unit; an unknown one raises `HistoryError` with the nearest serial number."""
        with self.database.reading() as connection:
            return Unit(self.database, reading.unit(connection, serial_number))

    def states(self, part_number: str | None = None) -> tuple[UnitState, ...]:
        """Return the states of all units, or of those of a part number, by part and serial number."""
        with self.database.reading() as connection:
            units = reading.units(connection)
            if part_number is not None:
                units = tuple(unit for unit in units if unit.part_number == part_number)
            unit_states = states(connection, None if part_number is None else [unit.id for unit in units])
        return tuple(unit_states[unit.id] for unit in units)

    def check(self, entry: Entry) -> None:
        """Refuse an entry that contradicts the history for any recording; `HistoryError`."""
        with self.database.reading() as connection:
            writing.check_statement(connection, entry)

    def missing(
        self,
        entry: Entry,
        recording: "Recording",
        actuator: "Actuator",
        seed: int = 0,
        methods: Sequence[str] = ("hybrid",),
    ) -> bool:
        """Return whether the recording has no diagnosis by one of `methods` with default settings.

        Raises
        ------
        HistoryError
            `entry` contradicts the history: the unit has another part number, hours or cycles go backwards,
            or another unit or flight has the recording.
        """
        key = recording_hash(recording)
        with self.database.reading() as connection:
            writing.check_entry(connection, entry, key)
            description = description_of(actuator)[0]
            return not any(
                reading.has_diagnosis(connection, key, KeptSettings(description, method, seed=seed))
                for method in methods
            )

    def kept(
        self,
        recording: "Recording",
        actuator: "Actuator",
        seed: int = 0,
        methods: Sequence[str] = ("hybrid",),
    ) -> KeptDiagnosis | None:
        """Return the last diagnosis of a recording by one of `methods` with default settings, or None."""
        description = description_of(actuator)[0]
        settings = [KeptSettings(description, method, seed=seed) for method in methods]
        with self.database.reading() as connection:
            return reading.diagnosis(connection, recording_hash(recording), settings)

    def add(
        self,
        entry: Entry,
        recording: "Recording",
        diagnosis: "Diagnosis",
        actuator: "Actuator | None" = None,
    ) -> Added:
        """Add a diagnosis of a recording; an existing diagnosis is not changed.

        A further diagnosis of the same recording with other settings is added; `Unit.diagnoses` then returns
        the new one. `actuator` is the description that was given for the diagnosis, by which `missing`
        searches: the description in the diagnosis also contains the laws that it has found. Default: the
        latter.

        Raises
        ------
        HistoryError
            As `missing`.
        """
        key = recording_hash(recording)
        digest, toml = description_of(actuator or diagnosis.actuator)
        settings = KeptSettings.of(diagnosis, digest)
        with self.writing() as connection:
            is_new = writing.add_diagnosis(connection, entry, recording, diagnosis, key, settings, toml)
        return Added(is_new, key)

    def add_removal(self, serial_number: str, removal: Removal) -> bool:
        """Add a removal of a known unit; return False if it already exists.

        Raises
        ------
        HistoryError
            The unit is unknown, or the history has another removal at these hours.
        """
        with self.writing() as connection:
            return writing.add_removal(connection, reading.unit(connection, serial_number), removal)

    def add_finding(self, serial_number: str, finding: Finding) -> bool:
        """Add a shop's finding on a known unit; return False if it already exists.

        Raises
        ------
        HistoryError
            The unit is unknown, or the history has another finding on this component at these hours.
        """
        with self.writing() as connection:
            return writing.add_finding(connection, reading.unit(connection, serial_number), finding)

    def withdraw(self, serial_number: str, mistake: Mistake) -> Withdrawal:
        """Withdraw a wrong entry; its content is kept on record (`Unit.withdrawals`).

        A recording is withdrawn with all its diagnoses, a flight with its last recording, and a unit with its
        last flight. A withdrawn entry may be added again, to another unit or at other hours.

        Raises
        ------
        HistoryError
            The unit or the entry is unknown, several entries match, or it is the unit's only recording and
            there are removals or findings.
        """
        with self.writing() as connection:
            return withdraw(connection, reading.unit(connection, serial_number), mistake)

    def add_events(self, *events: Event) -> int:
        """Add events in their order, all or none; return the number of new ones."""
        with self.writing() as connection:
            return add_events(connection, events)

    def events(
        self,
        *,
        unit: str | None = None,
        kinds: Sequence[str] = (),
        since: str | None = None,
        until: str | None = None,
        after: int | None = None,
        newest_first: bool = False,
        limit: int | None = None,
    ) -> tuple[Event, ...]:
        """Return the events that meet all of the conditions below, in the order in which they were added.

        Parameters
        ----------
        unit
            Serial number.
        kinds
            Kinds of `emaphm.history.events.KINDS`; all if empty.
        since, until
            Earliest time, and time before which they were made, ISO 8601; UTC without an offset.
        after
            Number of an event; only later events are returned.
        newest_first, limit
            Order, and largest number of events.

        Raises
        ------
        HistoryError
            `since` or `until` is not a time.
        """
        with self.database.reading() as connection:
            return read_events(
                connection,
                unit=unit,
                kinds=kinds,
                since=since,
                until=until,
                after=after,
                newest_first=newest_first,
                limit=limit,
            )

    def open_conditions(self, unit: str | None = None) -> tuple[Event, ...]:
        """Return the events that raised conditions not cleared since, of a unit or of all units."""
        with self.database.reading() as connection:
            return read_open_conditions(connection, unit)

    def keep_prognosis(self, serial_number: str, prognosis: KeptPrognosis) -> None:
        """Store a prognosis of a unit without curves, replacing the previous prognosis and its curves.

        `emaphm.prognosis.keeping.keep_with_curves` stores a prognosis with curves. `HistoryError` if the unit
        is unknown.
        """
        with self.writing() as connection:
            keep_prognosis(connection, reading.unit(connection, serial_number), prognosis)

    def basis(self, serial_number: str) -> Basis:
        """Return the basis of a prognosis that starts now; `HistoryError` if the unit is unknown.

        Call it before the evidence is read: an entry that is added in between then marks the prognosis as out
        of date although it was used. In the other order, the prognosis would count as current without it.
        """
        with self.database.reading() as connection:
            unit_id = reading.unit(connection, serial_number).id
            return bases(connection, UNITS.c.id == unit_id)[unit_id]

    def prognoses(self) -> dict[str, KeptPrognosis]:
        """Return the last stored prognosis by serial number, for the units that have one."""
        with self.database.reading() as connection:
            return read_prognoses(connection)
