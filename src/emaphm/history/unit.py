"""Unit of a history."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from emaphm.errors import ActuatorError, HistoryError
from emaphm.history import reading
from emaphm.history.entries import UnitEntries
from emaphm.history.kept_diagnosis import KeptDiagnosis
from emaphm.history.lives import Life
from emaphm.history.notes.descriptions import description_notes
from emaphm.history.records import Finding, Flight, Removal, Replacement, Withdrawal
from emaphm.history.storage.database import Database
from emaphm.history.withdrawing import read_withdrawals

if TYPE_CHECKING:
    import sqlalchemy as sa

    from emaphm.actuator import Actuator


@dataclass(frozen=True, eq=False)
class Unit:
    """A unit: its numbers, and methods that read its entries from the history.

    Each method raises `HistoryError` if the database fails, or if the unit was withdrawn meanwhile.
    """

    database: Database
    row: reading.UnitRow

    def __repr__(self) -> str:
        return f"Unit({self.part_number!r}, {self.serial_number!r})"

    @property
    def serial_number(self) -> str:
        """The serial number, unique in the history."""
        return self.row.serial_number

    @property
    def part_number(self) -> str:
        """The part number."""
        return self.row.part_number

    def _present(self, connection: "sa.Connection") -> reading.UnitRow:
        # Read again: after a withdrawal, its id may be that of another unit.
        return reading.unit(connection, self.serial_number)

    def _id(self, connection: "sa.Connection") -> int:
        return self._present(connection).id

    def entries(self) -> UnitEntries:
        """Return flights, removals, findings and withdrawals, read from one state of the history."""
        with self.database.reading() as connection:
            return UnitEntries.read(connection, self._id(connection), self.serial_number)

    def flights(self) -> tuple[Flight, ...]:
        """Return the flights with a recording, by hours."""
        with self.database.reading() as connection:
            return reading.flights(connection, self._id(connection))

    def diagnoses(self, latest: int | None = None, earlier: int = 0) -> tuple[KeptDiagnosis, ...]:
        """Return the last diagnosis of each recording, by hours, including unexplained ones.

        `latest` limits their number to the latest ones; `earlier` of the diagnoses before are added, evenly
        spread.
        """
        with self.database.reading() as connection:
            return reading.diagnoses(connection, self._id(connection), latest, earlier)

    def removals(self) -> tuple[Removal, ...]:
        """Return the removals, by hours."""
        with self.database.reading() as connection:
            return reading.removals(connection, self._id(connection))

    def findings(self) -> tuple[Finding, ...]:
        """Return the shop findings, by hours."""
        with self.database.reading() as connection:
            return reading.findings(connection, self._id(connection))

    def withdrawals(self) -> tuple[Withdrawal, ...]:
        """Return the withdrawals of entries of its serial number, in their order."""
        with self.database.reading() as connection:
            return read_withdrawals(connection, self.serial_number)

    def replacements(self) -> tuple[Replacement, ...]:
        """Return the replacements, by hours; the component "unit" means all components."""
        return tuple(
            Replacement(finding.hours, finding.component) for finding in self.findings() if finding.replaced
        )

    def lives(self, component: str | None = None) -> tuple[Life, ...]:
        """Return the lives of the unit between its removals, or of one component between its replacements.

        `emaphm.history.lives.lives` defines the end of a life, and censoring.
        """
        return self.entries().lives(component)

    def description_notes(self) -> tuple[str, ...]:
        """Return a note if its description differs from those of other units of the part number, or none."""
        with self.database.reading() as connection:
            return description_notes(connection, self._present(connection))

    @cached_property
    def actuator(self) -> "Actuator":
        """The description of its last diagnosis."""
        import tomllib

        from emaphm.actuator import Actuator

        with self.database.reading() as connection:
            toml = reading.description(connection, self._id(connection))
        assert toml is not None  # noqa: S101 - a unit is in the history by its diagnoses
        where = f"the description kept of unit '{self.serial_number}'"
        try:
            return Actuator.from_dict(tomllib.loads(toml), where=where)
        except ActuatorError as error:
            raise HistoryError(
                f"{error}; a newer version of emaphm may have stored it: update emaphm"
            ) from None

    def described_by(self, given: "Actuator | None") -> "Actuator":
        """Return the `given` description if any, otherwise that of the last diagnosis.

        Raises
        ------
        HistoryError
            The name of the given description is neither the unit's part number nor the name of the
            description of its last diagnosis: its requirements are those of another actuator.
        """
        if given is None or given.name in (self.part_number, self.actuator.name):
            return self.actuator if given is None else given
        raise HistoryError(
            f"unit '{self.serial_number}' has the part number '{self.part_number}', the description is of "
            f"'{given.name}'; check --unit and --actuator (with --all, --part selects the units), or, if "
            f'only its name is new, state name = "{self.actuator.name}" in it'
        )
