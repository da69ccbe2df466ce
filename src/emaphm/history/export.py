"""Export of a history to a file for other programs: JSON, CSV or Parquet."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from emaphm.actuator.faults import NAMES
from emaphm.history.blocks import unit_blocks
from emaphm.history.history import History
from emaphm.history.kept_diagnosis import KeptDiagnosis
from emaphm.history.unit import Unit
from emaphm.output_files import TABLES, check_writable, write_table, written_whole

if TYPE_CHECKING:
    import polars as pl

ENDINGS = (".json", *TABLES)


def export(history: History, path: Path, *, part_number: str | None = None, force: bool = False) -> int:
    """Write the units of a history, or those of a part number; return their number.

    .json contains the output of `emaphm history show --json` for each unit; .csv and .parquet have a row for
    each diagnosis: unit, hours, the eight components with standard errors and verdicts.

    Raises
    ------
    OutputError
        The file cannot be written there, or has another ending.
    HistoryError
        The database fails, or has no unit of the part number.
    """
    check_writable(path, force=force, endings=ENDINGS)
    history.check_part_number(part_number)
    units = history.units(part_number)
    if path.suffix.lower() == ".json":
        with written_whole(path) as temporary:
            _write_json(units, temporary)
    else:
        write_table(_table(units), path)
    return len(units)


def _write_json(units: tuple[Unit, ...], path: Path) -> None:
    """Write one unit per line: a fleet may be larger than the memory."""
    with path.open("w", encoding="utf-8") as file:
        file.write('{"units": [')
        for i, unit in enumerate(units):
            file.write(f"{',' if i else ''}\n{json.dumps(unit_blocks(unit))}")
        file.write("\n]}\n")


def _table(units: tuple[Unit, ...]) -> "pl.DataFrame":
    import polars as pl

    rows = [_row(unit, diagnosis) for unit in units for diagnosis in unit.diagnoses()]
    return pl.DataFrame(rows, schema=_columns(), orient="row")


def _columns() -> dict[str, Any]:
    import polars as pl

    about = dict.fromkeys(("part_number", "serial_number", "position"), pl.String)
    flight = {"hours": pl.Float64, "cycles": pl.Int64, "load": pl.Float64, "temperature": pl.Float64}
    of_recording = {"recording": pl.String, "recording_hash": pl.String, "explained": pl.Boolean}
    components = {
        f"{name}{suffix}": kind
        for name in NAMES
        for suffix, kind in (("", pl.Float64), ("_standard_error", pl.Float64), ("_verdict", pl.String))
    }
    settings = dict.fromkeys(("method", "model", "seed", "version"), pl.String)
    return {**about, **flight, **of_recording, **components, **settings}


def _row(unit: Unit, diagnosis: KeptDiagnosis) -> tuple[Any, ...]:
    flight, settings, verdicts = diagnosis.flight, diagnosis.settings, diagnosis.verdicts
    components = [
        value
        for name, estimate, error in zip(NAMES, diagnosis.vector, diagnosis.standard_errors, strict=True)
        for value in (float(estimate), float(error), verdicts[name])
    ]
    return (
        *(unit.part_number, unit.serial_number, flight.position, flight.hours, flight.cycles),
        *(flight.load, flight.temperature),
        *(diagnosis.recording, diagnosis.recording_hash, diagnosis.explained),
        *components,
        *(settings.method, settings.model, str(settings.seed), diagnosis.version),
    )
