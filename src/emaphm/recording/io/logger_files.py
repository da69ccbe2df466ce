"""Readers of Parquet, TDMS, HDF5 and MDF 4 files; each format's library runs in a separate process."""

import importlib.util
from collections.abc import Collection
from pathlib import Path

from emaphm.errors import RecordingError
from emaphm.recording.io.file_columns import FileColumns
from emaphm.recording.io.isolation import isolated_columns
from emaphm.recording.io.limits import ReadLimits


def read_parquet(path: Path, limits: ReadLimits, _: Collection[str] = ()) -> FileColumns:
    """Read the columns of a Parquet file.

    Parameters
    ----------
    path
        The file.
    limits
        Sizes beyond which the file is refused.

    Raises
    ------
    RecordingError
        The file is too large, is no Parquet file, or is damaged.
    """
    return isolated_columns("parquet", path, limits)


def read_tdms(path: Path, limits: ReadLimits, _: Collection[str] = ()) -> FileColumns:
    """Read the channels of a TDMS file as "group/channel"; each waveform has a separate time base.

    Parameters and errors as in `read_parquet`; an error also if npTDMS is not installed.
    """
    _need("nptdms", "npTDMS", "TDMS", path)
    return isolated_columns("tdms", path, limits)


def read_hdf5(path: Path, limits: ReadLimits, _: Collection[str] = ()) -> FileColumns:
    """Read the vectors of an HDF5 file, and the fields of its tables, as "group/name".

    Parameters and errors as in `read_parquet`; an error also if h5py is not installed.
    """
    _need("h5py", "h5py", "HDF5", path)
    return isolated_columns("hdf5 groups", path, limits)


def read_mdf(path: Path, limits: ReadLimits, asked_for: Collection[str] = ()) -> FileColumns:
    """Read the requested channels of an MDF 4 file as "group/channel" with their times.

    `asked_for` lists the names of the channels. The other parameters and the errors are as in `read_parquet`;
    an error also if asammdf is not installed.
    """
    _need("asammdf", "asammdf", "MDF 4", path)
    return isolated_columns("mdf", path, limits, asked_for)


def _need(module: str, package: str, kind: str, path: Path) -> None:
    if importlib.util.find_spec(module) is None:
        raise RecordingError(
            f"{path}: {'an' if kind[0] in 'HM' else 'a'} {kind} file needs {package}: pip install {package}; "
            "or export it as CSV or Parquet"
        )
