"""One unit of a history."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from emaphm.errors import HistoryError
from emaphm.history import reading
from emaphm.history.entries import UnitEntries
from emaphm.history.kept_diagnosis import KeptDiagnosis
from emaphm.history.lives import Life
from emaphm.history.notes.descriptions import description_notes
from emaphm.history.records import Finding, Flight, Removal, Replacement, Withdrawal
from emaphm.history.storage.database import Database
from emaphm.history.withdrawing import read_withdrawals

if TYPE_CHECKING:
    from emaphm.actuator import Actuator


@dataclass(frozen=True, eq=False)
class Unit:
    """A unit: its numbers, and what the history holds of it, which is read when asked for.

    Each method raises `HistoryError` where the database fails.
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

    def flights(self) -> tuple[Flight, ...]:
        """Return the flights of which there is a recording, by hours."""
        with self.database.reading() as connection:
            return reading.flights(connection, self.row.id)

    def diagnoses(self, latest: int | None = None, earlier: int = 0) -> tuple[KeptDiagnosis, ...]:
        """Return the last diagnosis of each recording, by hours, those that explain nothing among them.

        `latest` is how many of them at most, those of most hours, and `earlier` how many of those before,
        evenly spread.
        """
        with self.database.reading() as connection:
            return reading.diagnoses(connection, self.row.id, latest, earlier)

    def removals(self) -> tuple[Removal, ...]:
        """Return the removals, by hours."""
        with self.database.reading() as connection:
            return reading.removals(connection, self.row.id)

    def findings(self) -> tuple[Finding, ...]:
        """Return what shops found, by hours."""
        with self.database.reading() as connection:
            return reading.findings(connection, self.row.id)

    def withdrawals(self) -> tuple[Withdrawal, ...]:
        """Return what was entered wrongly under its serial number and withdrawn since, in that order."""
        with self.database.reading() as connection:
            return read_withdrawals(connection, self.serial_number)

    def replacements(self) -> tuple[Replacement, ...]:
        """Return what shops replaced, by hours; the component "unit" stands for all of them."""
        return tuple(Replacement(one.hours, one.component) for one in self.findings() if one.replaced)

    def lives(self, component: str | None = None) -> tuple[Life, ...]:
        """Return the lives of the unit between its removals, or of one component between its replacements.

        See `emaphm.history.lives.lives` for what ends one, and what censors it.
        """
        with self.database.reading() as connection:
            return UnitEntries.read(connection, self.row.id, self.serial_number).lives(component)

    def description_notes(self) -> tuple[str, ...]:
        """Return a note where its description is unlike those of other units of the part number, or none."""
        with self.database.reading() as connection:
            return description_notes(connection, self.row)

    @cached_property
    def actuator(self) -> "Actuator":
        """The description that its last diagnosis was made with."""
        import tomllib

        from emaphm.actuator import Actuator

        with self.database.reading() as connection:
            toml = reading.description(connection, self.row.id)
        assert toml is not None  # noqa: S101 - a unit is in the history by its diagnoses
        return Actuator.from_dict(
            tomllib.loads(toml), where=f"the description kept of unit '{self.serial_number}'"
        )

    def described_by(self, given: "Actuator | None") -> "Actuator":
        """Return the description to take: the `given` one if any, else that of the last diagnosis.

        Raises
        ------
        HistoryError
            The one given has another name than the unit's part number and the description of its last
            diagnosis have: its requirements are those of another actuator.
        """
        if given is None or given.name in (self.part_number, self.actuator.name):
            return self.actuator if given is None else given
        raise HistoryError(
            f"unit '{self.serial_number}' has the part number '{self.part_number}', the description is of "
            f"'{given.name}'; check --unit and --actuator (of --all, --part chooses the units), or, where "
            f'only its name is new, state name = "{self.actuator.name}" in it'
        )
