"""Table of the signals of replays: each channel, measured and modelled."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from emaphm.estimation.replay.single import Replay
from emaphm.output_files import TABLES, check_writable, write_table

if TYPE_CHECKING:
    import polars as pl

MODEL = "_model"
"""Suffix of the name of a modelled column; the measured column has no suffix."""


def series(replays: Sequence[Replay]) -> "pl.DataFrame":
    """Return the rows of all `replays`: time, command, and each compared channel, measured and modelled.

    For several recordings, a first column `recording` contains their names; channels that a recording does
    not have are empty.
    """
    import polars as pl

    frames = []
    for replay in replays:
        columns = {name: replay.recording[name] for name in ("time_s", "command_rad")}
        for name in replay.errors:
            columns |= {name: replay.recording[name], f"{name}{MODEL}": replay.signals[name]}
        frame = pl.DataFrame(columns)
        if len(replays) > 1:
            frame = frame.select(pl.lit(replay.recording.source).alias("recording"), pl.all())
        frames.append(frame)
    return pl.concat(frames, how="diagonal")


def write_series(replays: Sequence[Replay], path: str | Path, *, force: bool = False) -> None:
    """Write the table of `series` to a .csv or .parquet file.

    Raises
    ------
    OutputError
        See `emaphm.output_files.check_writable`.
    """
    check_writable(path, force=force, endings=TABLES)
    write_table(series(replays), path)
