"""Parquet."""

import io

import numpy as np

from emaphm.errors import RecordingError
from emaphm.recording.io.table import Table, excerpt, reason, tidy


def read_parquet(content: bytes, source: str) -> Table:
    """Read the columns of a Parquet file.

    Parameters
    ----------
    content
        The file's bytes.
    source
        Its name, for errors.

    Raises
    ------
    RecordingError
        It is no Parquet file, or is damaged.
    """
    import polars as pl

    try:
        frame = pl.read_parquet(io.BytesIO(content))
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException, OSError) as error:
        # A damaged footer can make polars panic, which is no ordinary exception.
        raise RecordingError(
            f"{source}: not a readable Parquet file ({reason(error)}); it may be cut short: copy or "
            "export it again"
        ) from None
    table = Table({}, {})
    for column in frame.get_columns():
        name = tidy(column.name)
        if column.dtype.is_numeric():
            table.numeric[name] = np.asarray(column.cast(float).to_numpy(), float)
            continue
        first = excerpt(column[0]) if len(column) else "nothing"
        table.unusable[name] = (
            f"is of type {column.dtype} (row 1: {first}), not numeric; store it as numbers in its SI unit"
        )
    return table
