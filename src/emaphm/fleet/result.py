"""Result of a recording of a batch, and the table of all results."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from emaphm.actuator.faults import degraded_in, health_in
from emaphm.text_table import NOTHING, format_table

LONGEST_NOTE = 100
"""Largest number of characters of a row's notes; a diagnosis of the recording alone has the full text."""

HEADER = ("recording", "explained", "residual", "degraded", "notes")


@dataclass(frozen=True, eq=False)
class BatchResult:
    """Result of one recording: `values` is the output of `emaphm diagnose --json`.

    For a recording that could not be diagnosed, it has only the `recording` and the `error`.
    """

    values: Mapping[str, Any]

    @property
    def recording(self) -> str:
        """The name of the recording."""
        return str(self.values["recording"])

    @property
    def error(self) -> str:
        """Reason why it could not be diagnosed, or empty."""
        return str(self.values.get("error", ""))

    @property
    def explained(self) -> bool:
        """Whether the recording is explained."""
        return bool(self.values.get("explained", False))

    @property
    def degraded(self) -> dict[str, float]:
        """The components with the verdict degraded, with their values."""
        if self.error:
            return {}
        return {name: self.values["faults"][name]["value"] for name in degraded_in(self.values)}

    @property
    def notes(self) -> tuple[str, ...]:
        """Short notes on the result."""
        if self.error:
            return (self.error.removeprefix(f"{self.recording}: "),)
        values = self.values
        notes = [] if values["moves"] else ["stands still"]
        notes += [f"also estimated: {', '.join(values['suspected'])}"] if values["suspected"] else []
        notes += [f"laws that the description lacks: {', '.join(values['laws'])}"] if values["laws"] else []
        return (*notes, *values["reasons"], *values["notes"])

    @property
    def _cells(self) -> tuple[str, str, str]:
        """Cells of the table: explained, residual, degraded components."""
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
    """A recording's row of the table: its cells, and the categories in which it is counted."""

    cells: tuple[str, ...]
    explained: bool
    degraded: bool
    broken: bool


def batch_table(rows: Sequence[BatchRow]) -> str:
    """Return a text table with one row per recording, and a summary line."""
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
