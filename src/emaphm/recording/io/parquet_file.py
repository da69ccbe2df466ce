"""Parquet."""

from pathlib import Path

from emaphm.recording.io.file_columns import FileColumns
from emaphm.recording.io.isolation import isolated_columns
from emaphm.recording.io.limits import ReadLimits


def read_parquet(path: Path, limits: ReadLimits) -> FileColumns:
    """Read the columns of a Parquet file.

    Parameters
    ----------
    path
        The file.
    limits
        Sizes beyond which it is refused.

    Raises
    ------
    RecordingError
        It is too large, is no Parquet file, or is damaged.
    """
    return isolated_columns("parquet", path, limits)
