"""Writing a recording to CSV or Parquet, by the file's ending."""

import io
from pathlib import Path

from emaphm.output_files import check_writable, written_whole
from emaphm.recording.recording import Recording

ENDINGS = (".csv", ".parquet")
"""What `write_recording` can write."""


def write_recording(recording: Recording, path: str | Path, *, force: bool = False) -> None:
    """Write all columns under their own names; their values are read back the same to the last bit.

    Labels become columns that are the same throughout, which reading makes labels of again. Neither the notes
    nor the sampling are kept: read rows that are instants with an actuator whose `channels.sampling` is
    "instant", else they are taken for means.

    Parameters
    ----------
    recording
        What to write.
    path
        A .csv or .parquet file; capitals do not matter.
    force
        Whether an existing file may be replaced.

    Raises
    ------
    OutputError
        See `check_writable`; also if the operating system refuses half-way, nothing being left then.
    """
    check_writable(path, force=force, endings=ENDINGS)
    import polars as pl

    labels = {name: value for name, value in recording.labels.items() if name not in recording}
    frame = recording.to_frame().with_columns(**{name: pl.lit(value) for name, value in labels.items()})
    # Through memory: where the disk is full, polars has errors of its own for each format.
    content = io.BytesIO()
    if Path(path).suffix.lower() == ".csv":
        frame.write_csv(content)
    else:
        frame.write_parquet(content)
    with written_whole(path) as temporary:
        temporary.write_bytes(content.getbuffer())
