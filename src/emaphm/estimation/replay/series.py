"""The signals of replays as a table: each channel, measured and modelled, side by side."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from emaphm.estimation.replay.single import Replay
from emaphm.output_files import check_writable, written_whole

if TYPE_CHECKING:
    import polars as pl

SERIES = (".csv", ".parquet")
"""Endings of the files that `write_series` writes."""

MODEL = "_model"
"""What the name of a model's column ends with; without, it is the measured one."""


def series(replays: Sequence[Replay]) -> "pl.DataFrame":
    """Return the rows of all `replays`: time, command, and each compared channel, measured and modelled.

    Of several recordings, their names in a first column `recording`; what one lacks is empty.
    """
    import polars as pl

    frames = []
    for one in replays:
        columns = {name: one.recording[name] for name in ("time_s", "command_rad")}
        for name in one.errors:
            columns |= {name: one.recording[name], f"{name}{MODEL}": one.signals[name]}
        frame = pl.DataFrame(columns)
        if len(replays) > 1:
            frame = frame.select(pl.lit(one.recording.source).alias("recording"), pl.all())
        frames.append(frame)
    return pl.concat(frames, how="diagonal")


def write_series(replays: Sequence[Replay], path: str | Path, *, force: bool = False) -> None:
    """Write the table of `series` to a .csv or .parquet file.

    Raises
    ------
    OutputError
        See `emaphm.output_files.check_writable`.
    """
    check_writable(path, force=force, endings=SERIES)
    content = io.BytesIO()
    if Path(path).suffix.lower() == ".csv":
        series(replays).write_csv(content)
    else:
        series(replays).write_parquet(content)
    with written_whole(path) as temporary:
        temporary.write_bytes(content.getbuffer())
