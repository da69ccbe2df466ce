"""Limits of a file's size: a file that needs too much memory or time is refused before it is read."""

from dataclasses import dataclass

from emaphm.errors import RecordingError

WAY_OUT = "cut one manoeuvre out of it (of a CSV, the first rows: head -n 100001 FILE > cut.csv)"


@dataclass(frozen=True)
class ReadLimits:
    """Limits of a file that is read.

    The defaults limit the memory of reading to about 3 GB: 0.7 GB and 2 s were measured for 1,000,000 rows of
    8 columns, a CSV file of 148 MB (``/usr/bin/time -v emaphm diagnose``). On a machine with more memory,
    pass other limits to `read_recording`.
    """

    file_bytes: int = 512 * 2**20
    """Size of the file [bytes]: 1,000,000 rows of 25 columns in a CSV file of full precision."""

    rows: int = 1_000_000
    """Rows of a column [-]: 200 s at 5 kHz. A diagnosis has a lower limit
    (`emaphm.recording.plausibility`)."""

    columns: int = 10_000
    """Columns or variables of a file [-]: each needs its name, its checks and its share of the messages."""

    numbers: int = 50_000_000
    """Rows times columns [-]: 400 MB in double precision, ten times as much while a CSV file is parsed."""

    isolated: bool = True
    """Whether Parquet, MDF 4, TDMS and HDF5 files, including MATLAB 7.3, are read in another process: on a
    damaged file their libraries can abort the calling process. The first file takes 0.3 s more, each further
    file a few milliseconds."""

    memory_bytes: int = 8 * 2**30
    """Address space of that process [bytes]: libraries reserve more than they use."""

    seconds: float = 60.0
    """Longest time of the process [s]: the largest file takes a tenth of it."""

    def check(self, rows: int, columns: int, source: str) -> None:
        """Raise `RecordingError` if rows, columns or their product exceed the limits."""
        if rows > self.rows:
            raise RecordingError(f"{source}: has {rows:,} rows, {self.rows:,} are read at most; {WAY_OUT}")
        if columns > self.columns:
            raise RecordingError(
                f"{source}: has {columns:,} columns, {self.columns:,} are read at most; export fewer"
            )
        if rows * columns > self.numbers:
            raise RecordingError(
                f"{source}: has {rows:,} rows of {columns:,} columns, {self.numbers:,} numbers are read at "
                "most; export fewer columns or rows"
            )
