"""`emaphm history …`: units over their flights."""

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

app = App(name="history", help="Keep diagnoses of units over their flights, removals and shop findings.")

app.command(add)


@app.command(name="list")
def list_units(*, part: Part = None, db: Database = DB, as_json: AsJson = False) -> None:
    """List the units, each with its hours and its latest diagnosis."""
    from emaphm.history import History
    from emaphm.text_table import format_table

    with History.open(db) as history:
        history.check_part_number(part)
        lines = [_overview(one) for one in history.states(part)]
    header = (
        "part number",
        "serial number",
        "hours",
        "cycles",
        "recordings",
        "explained",
        "degraded at the last",
    )
    rows = [
        (
            line["part_number"],
            line["serial_number"],
            f"{line['hours']:.9g}",
            number(line["cycles"]),
            str(line["recordings"]),
            str(line["explained"]),
            _last(line),
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
    """Show what the history holds of a unit, by hours; its JSON has the blocks of ISO 13374."""
    from emaphm.history import History
    from emaphm.history.blocks import unit_blocks

    with History.open(db) as history:
        values = unit_blocks(history.unit(unit))
    show(values, unit_text(values), as_json)


@app.command
def export(
    *,
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="File to write: .json, .csv or .parquet.")],
    part: Part = None,
    db: Database = DB,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Write the history: .json with the blocks of ISO 13374, .csv or .parquet with a row a diagnosis."""
    from emaphm.history import History
    from emaphm.history.export import export as write

    with History.open(db) as history:
        units = write(history, out, part_number=part, force=force)
    show({"file": str(out), "units": units}, f"{units} units written to {out}", as_json)


@app.command
def removal(
    *,
    unit: Unit,
    hours: Hours,
    reason: Annotated[
        str, Parameter(help="failed or suspected, as seen on the aircraft; scheduled; other.")
    ] = "other",
    note: Note = "",
    db: Database = DB,
    as_json: AsJson = False,
) -> None:
    """Add that a unit was taken off its aircraft."""
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
    """What a shop found of one component."""

    component: Annotated[
        str,
        Parameter(
            help="friction, backlash, short_a, short_b, short_c, eccentricity, gain; or unit, with a note."
        ),
    ]
    condition: Annotated[
        str, Parameter(help="failed, degraded (worn, but within its limits) or healthy (no fault found).")
    ]
    level: Annotated[
        float | None,
        Parameter(
            help="The fault as the shop measured it, from 0 to 1 as in a diagnosis; a friction from -1."
        ),
    ] = None
    replaced: Annotated[bool, Parameter(negative="", help="The component was replaced.")] = False
    note: Note = ""

    def entry(self, hours: float) -> "Finding":
        """Return the entry for the history, at flight `hours` [h]; `HistoryError` where it cannot be."""
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
    """Add what a shop found of a component, and whether it replaced it."""
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
    kind: Annotated[str, Parameter(help="recording, removal or finding.")],
    *,
    unit: Unit,
    hours: Hours,
    reason: Annotated[str, Parameter(help="Why it was wrong, for whoever reads the history later.")],
    which: Annotated[
        str | None,
        Parameter(help="A recording's name or hash, or a finding's component, where there are several."),
    ] = None,
    db: Database = DB,
    as_json: AsJson = False,
) -> None:
    """Take out an entry that was made wrongly; it counts no longer, and stays on record with the reason."""
    from dataclasses import asdict

    from emaphm.history import History, Mistake

    mistake = Mistake(kind, hours, reason, which)
    with History.open(db) as history:
        made = history.withdraw(unit, mistake)
        gone = all(one.serial_number != unit for one in history.units())
    values = {"unit": unit, "unit_left": not gone, **asdict(made)}
    last = "; it was its only recording, so the unit is no longer in the history" if gone else ""
    show(values, f"{named(values)} of {unit} at {hours:.9g} h is withdrawn{last}", as_json)


def _with_note(text: str, implausible: str | None) -> str:
    return text if implausible is None else f"{text}\nNote: {implausible}."


def _overview(one: "UnitState") -> dict[str, Any]:
    from emaphm.actuator.faults import degraded_in, health_in

    document = one.document
    return {
        "part_number": one.part_number,
        "serial_number": one.serial_number,
        "hours": one.hours,
        "cycles": one.cycles,
        "recordings": one.recordings,
        "explained": one.explained,
        "last": {
            "explained": document["explained"],
            "health": health_in(document),
            "k": document["k"],
            "degraded": list(degraded_in(document)),
        },
    }


def _last(line: dict[str, Any]) -> str:
    last = line["last"]
    return ", ".join(last["degraded"]) or ("none" if last["health"] == "healthy" else last["health"])


def _added(added: bool) -> str:
    return "added" if added else "is in the history already"
