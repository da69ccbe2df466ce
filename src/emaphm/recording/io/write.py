"""Writing a recording to a CSV or Parquet file, according to the file's ending."""

from pathlib import Path

from emaphm.output_files import TABLES, check_writable, write_table
from emaphm.recording.recording import Label, Recording


def write_recording(recording: Recording, path: str | Path, *, force: bool = False) -> None:
    """Write all columns under their names in the recording; reading returns the same values bit for bit.

    Labels are written as constant columns, which become labels again when they are read. In a CSV, texts are
    in quotes if one of them could be taken for a number. Notes and sampling are not written: to read rows
    that are instants, use an actuator whose `channels.sampling` is "instant", else they are taken as means.

    Parameters
    ----------
    recording
        Recording to write.
    path
        A .csv or .parquet file, in upper or lower case.
    force
        Whether an existing file may be replaced.

    Raises
    ------
    OutputError
        See `check_writable`; also if the operating system refuses to write: then no partial file is left.
    """
    check_writable(path, force=force, endings=TABLES)
    import polars as pl

    labels = {name: value for name, value in recording.labels.items() if name not in recording}
    frame = recording.to_frame().with_columns(**{name: pl.lit(value) for name, value in labels.items()})
    write_table(frame, path, quote_texts=any(_looks_like_number(value) for value in labels.values()))


def _looks_like_number(label: Label) -> bool:
    """Return whether a label is a text that would be read as a number, such as the serial number 42."""
    if not isinstance(label, str):
        return False
    try:
        float(label)
    except ValueError:
        return False
    return True
