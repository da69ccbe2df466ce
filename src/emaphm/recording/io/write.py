"""Writing a recording to CSV or Parquet, told apart by the file's ending."""

from pathlib import Path

from emaphm.output_files import check_writable, written_whole
from emaphm.recording.recording import Recording

ENDINGS = (".csv", ".parquet")
"""What `write_recording` can write."""


def write_recording(recording: Recording, path: str | Path, *, force: bool = False) -> None:
    """Write all columns under their own names; what is read back is the same to the last bit.

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
    frame = recording.to_frame()
    with written_whole(path) as temporary:
        if Path(path).suffix.lower() == ".csv":
            frame.write_csv(temporary)
        else:
            frame.write_parquet(temporary)
