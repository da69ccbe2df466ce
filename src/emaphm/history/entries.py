"""All entries of a unit, read from one state of the history."""

from dataclasses import asdict, dataclass
from typing import Any, Self

import sqlalchemy as sa

from emaphm.history import reading
from emaphm.history.lives import Life, lives
from emaphm.history.records import Finding, Flight, Removal, Withdrawal
from emaphm.history.withdrawing import read_withdrawals


@dataclass(frozen=True)
class UnitEntries:
    """Flights, removals and findings of a unit, by hours, and its withdrawals, in the order of their time.

    Its diagnoses, which may be many, are read separately (`emaphm.history.reading.diagnoses`).
    """

    flights: tuple[Flight, ...]
    removals: tuple[Removal, ...]
    findings: tuple[Finding, ...]
    withdrawals: tuple[Withdrawal, ...]

    @classmethod
    def read(cls, connection: sa.Connection, unit_id: int, serial_number: str) -> Self:
        """Return the entries of the unit with this id and serial number."""
        return cls(
            reading.flights(connection, unit_id),
            reading.removals(connection, unit_id),
            reading.findings(connection, unit_id),
            read_withdrawals(connection, serial_number),
        )

    def lives(self, component: str | None = None) -> tuple[Life, ...]:
        """Return the lives of the unit, or of a component: `emaphm.history.lives.lives`."""
        return lives(self.flights, self.removals, self.findings, component)

    def to_dict(self) -> dict[str, list[dict[str, Any]]]:
        """Return the entries by their kind, ready for `json.dumps`."""
        return {
            "flights": [asdict(flight) for flight in self.flights],
            "removals": [asdict(removal) for removal in self.removals],
            "findings": [asdict(finding) for finding in self.findings],
            "withdrawals": [asdict(withdrawal) for withdrawal in self.withdrawals],
        }
