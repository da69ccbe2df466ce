"""How much is read of a file: what would exhaust memory or patience is refused before it is read."""

from dataclasses import dataclass

from emaphm.errors import RecordingError

WAY_OUT = "cut one manoeuvre out of it (of a CSV, the first rows: head -n 100001 FILE > cut.csv)"


@dataclass(frozen=True)
class ReadLimits:
    """Largest file that is read.

    The defaults bound the memory of reading to some 3 GB: 0.7 GB and 2 s were measured for 1,000,000 rows of
    8 columns, a CSV file of 148 MB (``/usr/bin/time -v emaphm diagnose``). Pass others to `read_recording` on
    a machine that has more.
    """

    file_bytes: int = 512 * 2**20
    """Size of the file [bytes]: 1,000,000 rows of 25 columns, as CSV of full precision."""

    rows: int = 1_000_000
    """Rows of a column [-]: 200 s at 5 kHz. A diagnosis takes fewer (`emaphm.recording.plausibility`)."""

    columns: int = 10_000
    """Columns or variables of a file [-]: each has its name, its checks and its share of the messages."""

    numbers: int = 50_000_000
    """Rows times columns [-]: 400 MB in double precision, ten times as much while a CSV is parsed."""

    isolated: bool = True
    """Whether Parquet, MDF 4, TDMS and HDF5 files, MATLAB 7.3 among them, are read by another process: on a
    damaged file their libraries can abort the process that calls them. The first file takes 0.3 s, each
    further one some milliseconds."""

    memory_bytes: int = 8 * 2**30
    """Address space of that process [bytes]: libraries reserve more than they use."""

    seconds: float = 60.0
    """Time that the process may take [s]: the largest file takes a tenth of it."""

    def check(self, rows: int, columns: int, source: str) -> None:
        """Raise `RecordingError` for a file of more rows, columns or numbers than are read."""
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
