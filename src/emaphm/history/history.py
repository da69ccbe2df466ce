"""The history of the units of a fleet."""

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
    """What became of a diagnosis: `added`, or there already; and its recording's SHA-256."""

    added: bool
    recording_hash: str


@dataclass(frozen=True, eq=False)
class History:
    """Units, flights, recordings, diagnoses, removals and shop findings, in a SQLite file or on PostgreSQL.

    To be closed, or used in a ``with`` statement. When a method that writes returns, its changes are on disk.
    Any number of processes may read and write. Each method raises `HistoryError` where the database fails.

    >>> with History.open("fleet.sqlite") as history:                                       # doctest: +SKIP
    ...     for diagnosis in history.unit("SN-0042").diagnoses():
    ...         print(diagnosis.hours, diagnosis.vector, diagnosis.explained)
    """

    database: Database

    @classmethod
    def open(cls, where: str | Path, *, create: bool = False) -> Self:
        """Return the history at `where`; an older form of the database is brought up to date.

        Parameters
        ----------
        where
            A file, or postgresql://USER@HOST:PORT/DATABASE.
        create
            Whether to make a history where there is none.

        Raises
        ------
        HistoryError
            There is no history, the database cannot be reached within ten seconds, or it is something else or
            of a newer version.
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
        """Yield a connection that alone may write; what it wrote stays if the body ends, all or nothing.

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
        """Refuse a part number that no unit has, `HistoryError` with the nearest; none where left out."""
        with self.database.reading() as connection:
            known = {row.part_number for row in reading.units(connection)}
        # Where there are no units, none is missed.
        if part_number is not None and known and part_number not in known:
            raise HistoryError(f"no units of the part number '{part_number}'{nearest(part_number, known)}")

    def unit(self, serial_number: str) -> Unit:
        """Return a unit; an unknown one raises `HistoryError` with the nearest serial number."""
        with self.database.reading() as connection:
            return Unit(self.database, reading.unit(connection, serial_number))

    def states(self, part_number: str | None = None) -> tuple[UnitState, ...]:
        """Return the state of each unit, or of those of a part number, by part and serial number."""
        with self.database.reading() as connection:
            units = reading.units(connection)
            if part_number is not None:
                units = tuple(one for one in units if one.part_number == part_number)
            found = states(connection, None if part_number is None else [one.id for one in units])
        return tuple(found[one.id] for one in units)

    def check(self, entry: Entry) -> None:
        """Refuse an entry that contradicts the history whatever its recording is; `HistoryError`."""
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
        """Return whether no diagnosis of a recording by one of `methods`, with usual settings, is there yet.

        Raises
        ------
        HistoryError
            `entry` contradicts the history: the unit has another part number, hours or cycles go backwards,
            or the recording is there already, of another unit or flight.
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
        """Return the last diagnosis of a recording by one of `methods`, with usual settings, None if none."""
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
        """Add a diagnosis of a recording; nothing changes where it is there already.

        A second diagnosis of the same recording, by other settings, is added too; `Unit.diagnoses` then gives
        the new one. `actuator` is the description that was given for the diagnosis, under which `missing`
        looks for it: that of the diagnosis has the laws too that it has found. The same if left out.

        Raises
        ------
        HistoryError
            As `missing`.
        """
        key = recording_hash(recording)
        digest, toml = description_of(actuator or diagnosis.actuator)
        settings = KeptSettings.of(diagnosis, digest)
        with self.writing() as connection:
            new = writing.add_diagnosis(connection, entry, recording, diagnosis, key, settings, toml)
        return Added(new, key)

    def add_removal(self, serial_number: str, removal: Removal) -> bool:
        """Add a removal of a known unit; return False where it is there already.

        Raises
        ------
        HistoryError
            The unit is unknown, or the history has another removal at these hours.
        """
        with self.writing() as connection:
            return writing.add_removal(connection, reading.unit(connection, serial_number), removal)

    def add_finding(self, serial_number: str, finding: Finding) -> bool:
        """Add what a shop found of a known unit; return False where it is there already.

        Raises
        ------
        HistoryError
            The unit is unknown, or the history has another finding on this component at these hours.
        """
        with self.writing() as connection:
            return writing.add_finding(connection, reading.unit(connection, serial_number), finding)

    def withdraw(self, serial_number: str, mistake: Mistake) -> Withdrawal:
        """Take out an entry that was made by mistake; its content stays on record (`Unit.withdrawals`).

        A recording goes with all its diagnoses, a flight with its last recording, and a unit with its last
        flight. What was withdrawn may be added again, to another unit or at other hours.

        Raises
        ------
        HistoryError
            The unit or the entry is unknown, several are meant, or it is the unit's only recording while
            removals or findings are left.
        """
        with self.writing() as connection:
            return withdraw(connection, reading.unit(connection, serial_number), mistake)

    def add_events(self, *events: Event) -> int:
        """Add events in their order, all or none; return how many were not there yet."""
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
            Of `emaphm.history.events.KINDS`; all where empty.
        since, until
            First time and the time before which they were made, ISO 8601; UTC where it has no offset.
        after
            The number of an event; only later ones.
        newest_first, limit
            The order, and how many at most.

        Raises
        ------
        HistoryError
            `since` or `until` is no time.
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
        """Return the events that raised what has not been cleared since, of a unit or of all."""
        with self.database.reading() as connection:
            return read_open_conditions(connection, unit)

    def keep_prognosis(self, serial_number: str, prognosis: KeptPrognosis) -> None:
        """Keep a prognosis of a unit, without curves, in place of the one before with its curves.

        `emaphm.prognosis.keeping.keep_with_curves` keeps one with its curves. `HistoryError` if the unit is
        unknown.
        """
        with self.writing() as connection:
            keep_prognosis(connection, reading.unit(connection, serial_number), prognosis)

    def basis(self, serial_number: str) -> Basis:
        """Return what a prognosis that begins now is made from; `HistoryError` if the unit is unknown.

        To be asked for before the evidence is read: what is added in between then makes the prognosis out of
        date though it is in it, in place of current though it is not.
        """
        with self.database.reading() as connection:
            unit_id = reading.unit(connection, serial_number).id
            return bases(connection, UNITS.c.id == unit_id)[unit_id]

    def prognoses(self) -> dict[str, KeptPrognosis]:
        """Return the last kept prognosis by serial number, of the units that have one."""
        with self.database.reading() as connection:
            return read_prognoses(connection)
