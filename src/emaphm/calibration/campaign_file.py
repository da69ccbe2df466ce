"""Campaign files: a TOML or CSV file with one row per recording and its known values.

In a TOML file, each row is a `[[recording]]` with its `file`, known values by name, and `free`, a list of
parameters to estimate for this recording alone. A CSV file has a column `file`, a column for each known
quantity, and a column `free` with names separated by semicolons or spaces; an empty cell means no value.
Paths are relative to the campaign file.
"""

import csv
import io
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from emaphm.actuator import Actuator
from emaphm.calibration.campaign import CampaignRow, check_known_name
from emaphm.errors import MethodError, RecordingError, nearest
from emaphm.input_files import MOST_TOML_BYTES, is_file, read_bytes, read_toml
from emaphm.recording import Recording, read_recording

FILE, FREE = "file", "free"

MOST_ROWS = 1000
"""Largest number of recordings in a campaign; each is simulated some thousand times."""


def is_campaign(path: Path) -> bool:
    """Return whether a file is a campaign: a TOML, or a CSV with a column `file`."""
    if path.suffix.lower() == ".toml":
        return True
    if path.suffix.lower() != ".csv" or not is_file(path, MethodError):
        return False
    try:
        with path.open("rb") as file:
            header = file.readline(10_000).decode("utf-8-sig", errors="replace")
    except OSError:  # the reader of its only recording names the reason
        return False
    return FILE in [name.strip().strip('"') for name in header.replace(";", ",").split(",")]


def read_campaign(
    path: str | Path,
    actuator: Actuator,
    read: Callable[[Path, Actuator], Recording] = read_recording,
) -> tuple[CampaignRow, ...]:
    """Read a campaign and its recordings; return its rows.

    Parameters
    ----------
    path
        A `.toml` or `.csv` file in the format above.
    actuator
        Actuator whose description maps the names of the recordings' channels.
    read
        Function that reads a recording.

    Raises
    ------
    MethodError
        The campaign cannot be read, has no row or a row without file; a quantity is unknown or its value is
        no number; a file or column is given twice.
    RecordingError
        A recording cannot be read.
    """
    path = Path(path)
    rows = _toml_rows(path) if path.suffix.lower() == ".toml" else _csv_rows(path)
    if not rows:
        raise MethodError(f"{path}: no recording in this campaign; give one row a recording, with its file")
    if len(rows) > MOST_ROWS:
        raise MethodError(f"{path}: {len(rows)} recordings are too many; {MOST_ROWS} are possible")
    parsed = {i: _parsed(values, f"{path}, row {i}") for i, values in rows.items()}
    _check_files(path, parsed)
    return tuple(_row(path, i, values, actuator, read) for i, values in parsed.items())


def _toml_rows(path: Path) -> Mapping[int, Mapping[str, Any]]:
    content = read_toml(path, "campaign file", MethodError)
    for key in content:
        if key != "recording":
            raise MethodError(f"{path}: unknown key '{key}'; a campaign has [[recording]] tables only")
    rows = content.get("recording", [])
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise MethodError(f"{path}: 'recording' is no list of tables; write [[recording]] above each")
    return dict(enumerate(rows, start=1))


def _csv_rows(path: Path) -> Mapping[int, Mapping[str, Any]]:
    try:
        text = read_bytes(path, MOST_TOML_BYTES, MethodError).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise MethodError(f"{path}: cannot be read as a text file ({error})") from None
    separator = ";" if ";" in text.partition("\n")[0] else ","
    reader = csv.DictReader(io.StringIO(text, newline=""), delimiter=separator, skipinitialspace=True)
    names = [name.strip() for name in reader.fieldnames or ()]
    for name in filter(None, names):
        if names.count(name) > 1:
            raise MethodError(f"{path}: {names.count(name)} columns are named '{name}'; leave one")
    rows = {}
    for i, row in _numbered(reader, path):
        if None in row:
            raise MethodError(f"{path}, row {i}: has more cells than the header; take them out")
        cells = {name.strip(): (value or "").strip() for name, value in row.items()}
        rows[i] = {name: value for name, value in cells.items() if value}
    return {i: row for i, row in rows.items() if row}


def _numbered(reader: "csv.DictReader[str]", path: Path) -> Iterator[tuple[int, dict[str, Any]]]:
    try:
        yield from enumerate(reader, start=1)
    except csv.Error as error:
        raise MethodError(f"{path}: not a readable CSV file ({error}); check its quotes") from None


def _parsed(values: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return file, free parameters and known values of a row."""
    if not isinstance(values.get(FILE), str):
        close = "" if FILE in values else nearest(FILE, values)
        raise MethodError(f"{where}: column 'file' is missing{close}; give the path of the recording")
    if "\0" in values[FILE]:
        raise MethodError(f"{where}, column 'file': no file can have this name; correct the path")
    known = {}
    for name, value in values.items():
        if name in (FILE, FREE):
            continue
        check_known_name(name, where)
        try:
            known[name] = float(value)
        except (TypeError, ValueError, OverflowError):
            raise MethodError(f"{where}, column '{name}': {value!r} is no number; give one") from None
        if isinstance(value, bool):
            raise MethodError(f"{where}, column '{name}': {value!r} is no number; give one")
    free = values.get(FREE, [])
    names = free.replace(";", " ").replace(",", " ").split() if isinstance(free, str) else free
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise MethodError(f"{where}, column 'free': give a list of parameters")
    return {FILE: values[FILE], FREE: tuple(dict.fromkeys(names)), "known": known}


def _check_files(path: Path, rows: Mapping[int, Mapping[str, Any]]) -> None:
    """Raise `MethodError` if two rows have the same file; `rows` by their number in the file."""
    first: dict[Path, int] = {}
    for i, row in rows.items():
        file = _resolved(path, row[FILE])
        if file not in first:
            first[file] = i
            continue
        before = rows[first[file]]
        same = {**row["known"], FREE: row[FREE]} == {**before["known"], FREE: before[FREE]}
        differing = "" if same else ", with other values"
        raise MethodError(
            f"{path}, row {i}, column 'file': '{row[FILE]}' stands in row {first[file]} already{differing}; "
            "leave one of the two out"
        )


def _resolved(campaign: Path, file: str) -> Path:
    return (campaign.parent / file).resolve()


def _row(
    path: Path,
    number: int,
    row: Mapping[str, Any],
    actuator: Actuator,
    read: Callable[[Path, Actuator], Recording],
) -> CampaignRow:
    where = f"{path}, row {number}"
    file = path.parent / row[FILE]
    if not is_file(file, MethodError):
        raise MethodError(
            f"{where}, column 'file': there is no file {file}; give its path from the campaign's folder"
        )
    try:
        recording = read(file, actuator)
    except RecordingError as error:
        raise RecordingError(f"{where}: {error}") from None
    return CampaignRow(recording, row["known"], row[FREE], where)
