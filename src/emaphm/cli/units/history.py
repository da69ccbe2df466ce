"""The verbs `history …`: diagnoses, removals and shop findings of units over their flights."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, Parameter

from emaphm.cli.options import (
    AsJson,
    Force,
)
from emaphm.cli.output import show
from emaphm.cli.units.history_add import add
from emaphm.cli.units.history_options import DB, Database, Hours, Note, Part, Unit
from emaphm.cli.units.unit_text import named, number, unit_text

if TYPE_CHECKING:
    from emaphm.history import Finding
    from emaphm.history.views import UnitState

app = App(
    name="history", help="Store and show diagnoses of units over their flights, removals and shop findings."
)

app.command(add)


@app.command(name="list")
def list_units(*, part: Part = None, db: Database = DB, as_json: AsJson = False) -> None:
    """List the units with their flight hours and latest diagnoses."""
    from emaphm.history import History
    from emaphm.text_table import format_table

    with History.open(db) as history:
        history.check_part_number(part)
        lines = [_overview(state) for state in history.states(part)]
    header = (
        "part number",
        "serial number",
        "hours",
        "cycles",
        "recordings",
        "explained",
        "degraded in the latest",
    )
    rows = [
        (
            line["part_number"],
            line["serial_number"],
            f"{line['hours']:.9g}",
            number(line["cycles"]),
            str(line["recordings"]),
            str(line["explained"]),
            _latest_verdict(line),
        )
        for line in lines
    ]
    show({"units": lines}, format_table(header, rows) if rows else "no units", as_json)


@app.command(name="show")
def show_unit(
    *,
    unit: Unit,
    db: Database = DB,
    as_json: AsJson = False,
) -> None:
    """Show all entries of a unit by flight hours; with --json, in the processing blocks of ISO 13374."""
    from emaphm.history import History
    from emaphm.history.blocks import unit_blocks

    with History.open(db) as history:
        values = unit_blocks(history.unit(unit))
    show(values, unit_text(values), as_json)


@app.command
def export(
    *,
    out: Annotated[
        Path, Parameter(name=("--out", "-o"), help="File to write: .json; or a table, .csv or .parquet.")
    ],
    part: Part = None,
    db: Database = DB,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Write the history to a file: .json with the blocks of ISO 13374, or a table of all diagnoses."""
    from emaphm.history import History
    from emaphm.history.export import export as write
    from emaphm.text_table import counted

    with History.open(db) as history:
        units = write(history, out, part_number=part, force=force)
    show({"file": str(out), "units": units}, f"{counted(units, 'unit')} written to {out}", as_json)


@app.command
def removal(
    *,
    unit: Unit,
    hours: Hours,
    reason: Annotated[
        str,
        Parameter(
            help="Reason of the removal: failed or suspected, as observed on the aircraft; scheduled; or "
            "other."
        ),
    ] = "other",
    note: Note = "",
    db: Database = DB,
    as_json: AsJson = False,
) -> None:
    """Record the removal of a unit from its aircraft."""
    from dataclasses import asdict

    from emaphm.history import History, Removal
    from emaphm.history.notes.hours import implausible_removal

    entry = Removal(hours, reason, note)
    with History.open(db) as history:
        added = history.add_removal(unit, entry)
        implausible = implausible_removal(history.unit(unit), entry)
    values = {"unit": unit, **asdict(entry), "added": added, "doubt": implausible}
    show(values, _with_note(f"removal of {unit} at {hours:.9g} h {_added(added)}", implausible), as_json)


@Parameter(name="*")
@dataclass(frozen=True)
class ShopFinding:
    """The finding of a shop on one component."""

    component: Annotated[
        str,
        Parameter(
            help="Component: friction, backlash, short_a, short_b, short_c, eccentricity, gain; or unit, "
            "with a note."
        ),
    ]
    condition: Annotated[
        str,
        Parameter(
            help="Condition of the component: failed, degraded (worn, but within its limits) or healthy (no "
            "fault found)."
        ),
    ]
    level: Annotated[
        float | None,
        Parameter(
            help="Normalised fault measured by the shop, from 0 to 1 (friction from -1), as in a diagnosis."
        ),
    ] = None
    replaced: Annotated[bool, Parameter(negative="", help="Record that the component was replaced.")] = False
    note: Note = ""

    def entry(self, hours: float) -> "Finding":
        """Return the entry for the history, at flight `hours` [h]; `HistoryError` if it is invalid."""
        from emaphm.history import Finding

        return Finding(hours, self.component, self.condition, self.level, self.replaced, self.note)


@app.command
def finding(
    *,
    unit: Unit,
    hours: Hours,
    found: ShopFinding,
    db: Database = DB,
    as_json: AsJson = False,
) -> None:
    """Record the finding of a shop on a component, and whether the component was replaced."""
    from dataclasses import asdict

    from emaphm.history import History
    from emaphm.history.notes.contradictions import contradiction
    from emaphm.history.notes.hours import implausible_finding

    entry = found.entry(hours)
    with History.open(db) as history:
        added = history.add_finding(unit, entry)
        known = history.unit(unit)
        implausible = implausible_finding(known, entry)
        notes = contradiction(entry, known.diagnoses(), known.findings())
    values = {"unit": unit, **asdict(entry), "added": added, "doubt": implausible, "notes": notes}
    text = f"finding on {found.component} of {unit} at {hours:.9g} h {_added(added)}"
    show(values, "\n".join([_with_note(text, implausible), *(f"Note: {note}." for note in notes)]), as_json)


@app.command
def withdraw(
    kind: Annotated[str, Parameter(help="Kind of the entry: recording, removal or finding.")],
    *,
    unit: Unit,
    hours: Hours,
    reason: Annotated[
        str, Parameter(help="Reason why the entry is wrong; it is stored for later readers of the history.")
    ],
    which: Annotated[
        str | None,
        Parameter(
            help="Name or hash of the recording, or component of the finding; required if the unit has "
            "several at these hours."
        ),
    ] = None,
    db: Database = DB,
    as_json: AsJson = False,
) -> None:
    """Withdraw a wrong entry: it is no longer used, but remains in the history with the reason."""
    from dataclasses import asdict

    from emaphm.history import History, Mistake

    mistake = Mistake(kind, hours, reason, which)
    with History.open(db) as history:
        made = history.withdraw(unit, mistake)
        gone = all(stored.serial_number != unit for stored in history.units())
    values = {"unit": unit, "unit_left": not gone, **asdict(made)}
    last = "; it was its only recording, so the unit is no longer in the history" if gone else ""
    show(values, f"{named(values)} of {unit} at {hours:.9g} h is withdrawn{last}", as_json)


def _with_note(text: str, implausible: str | None) -> str:
    return text if implausible is None else f"{text}\nNote: {implausible}."


def _overview(state: "UnitState") -> dict[str, Any]:
    from emaphm.actuator.faults import degraded_in, health_in

    document = state.document
    return {
        "part_number": state.part_number,
        "serial_number": state.serial_number,
        "hours": state.hours,
        "cycles": state.cycles,
        "recordings": state.recordings,
        "explained": state.explained,
        "last": {
            "explained": document["explained"],
            "health": health_in(document),
            "k": document["k"],
            "degraded": list(degraded_in(document)),
        },
    }


def _latest_verdict(line: dict[str, Any]) -> str:
    """Return the degraded components of a unit's latest diagnosis, "none", or "cannot tell"."""
    latest = line["last"]
    return ", ".join(latest["degraded"]) or ("none" if latest["health"] == "healthy" else latest["health"])


def _added(added: bool) -> str:
    return "added" if added else "is in the history already"
