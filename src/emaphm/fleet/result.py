"""What became of one recording of a batch, and the table of all."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from emaphm.actuator.faults import degraded_in, health_in
from emaphm.text_table import NOTHING, format_table

LONGEST_NOTE = 100
"""Characters of a row's notes; the whole text is in the diagnosis of that recording alone."""

HEADER = ("recording", "explained", "residual", "degraded", "notes")


@dataclass(frozen=True, eq=False)
class BatchResult:
    """One recording's result: `values` is what `emaphm diagnose --json` prints of it.

    Of a recording that could not be diagnosed, it has the `recording` and the `error` alone.
    """

    values: Mapping[str, Any]

    @property
    def recording(self) -> str:
        """The name of the recording."""
        return str(self.values["recording"])

    @property
    def error(self) -> str:
        """Why it could not be diagnosed; empty where it could."""
        return str(self.values.get("error", ""))

    @property
    def explained(self) -> bool:
        """Whether the diagnosis explains the recording."""
        return bool(self.values.get("explained", False))

    @property
    def degraded(self) -> dict[str, float]:
        """The components that are called degraded, with their values."""
        if self.error:
            return {}
        return {name: self.values["faults"][name]["value"] for name in degraded_in(self.values)}

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader must know of it, in short."""
        if self.error:
            return (self.error.removeprefix(f"{self.recording}: "),)
        values = self.values
        found = [] if values["moves"] else ["stands still"]
        found += [f"also estimated: {', '.join(values['suspected'])}"] if values["suspected"] else []
        found += [f"laws that the description lacks: {', '.join(values['laws'])}"] if values["laws"] else []
        return (*found, *values["reasons"], *values["notes"])

    @property
    def _cells(self) -> tuple[str, str, str]:
        """Whether it is explained, the residual, and what is degraded."""
        degraded = ", ".join(f"{name} {value:.2f}" for name, value in self.degraded.items())
        none = "none" if health_in(self.values) == "healthy" else "cannot tell"
        residual = f"{100 * self.values['relative_residual']:.1f} %"
        return "yes" if self.explained else "no", residual, degraded or none

    @property
    def row(self) -> "BatchRow":
        """The recording's row of the table."""
        notes = "; ".join(self.notes)
        if len(notes) > LONGEST_NOTE:
            notes = f"{notes[: LONGEST_NOTE - 1]}…"
        cells = (NOTHING,) * 3 if self.error else self._cells
        return BatchRow(
            (self.recording, *cells, notes), self.explained, bool(self.degraded), broken=bool(self.error)
        )


@dataclass(frozen=True)
class BatchRow:
    """What the table keeps of a recording: its cells, and what it counts as."""

    cells: tuple[str, ...]
    explained: bool
    degraded: bool
    broken: bool


def batch_table(rows: Sequence[BatchRow]) -> str:
    """Return a table of text with one row a recording, and a line of summary."""
    explained, degraded, broken = (
        sum(getattr(row, name) for row in rows) for name in ("explained", "degraded", "broken")
    )
    summary = (
        f"{len(rows)} recording{'s' if len(rows) > 1 else ''}: {explained} explained, {degraded} of them "
        f"with a degraded component; {len(rows) - explained - broken} not explained"
    )
    if broken:
        summary += f"; {broken} could not be diagnosed"
    return f"{format_table(HEADER, [row.cells for row in rows])}\n{summary}."
