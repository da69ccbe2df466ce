"""Reader of MATLAB .mat files: it selects the parser of the version, and the variables that are columns."""

import importlib.util
from collections.abc import Collection
from pathlib import Path

import numpy as np

from emaphm.errors import RecordingError
from emaphm.input_files import read_bytes
from emaphm.recording.io.file_columns import FileColumns, check_names
from emaphm.recording.io.foreign_columns import shape_complaint
from emaphm.recording.io.isolation import isolated_columns
from emaphm.recording.io.limits import ReadLimits
from emaphm.recording.io.mat_binary import MatError, Variable, read_version_4, read_version_5

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
HDF5_OFFSETS = (0, 512)
"""Possible positions of the signature: MATLAB writes a header before it."""

BYTE_ORDERS = {b"IM": "<", b"MI": ">"}
"""NumPy's byte order by the last two bytes of the header of version 5."""


def read_mat(path: Path, limits: ReadLimits, _: Collection[str] = ()) -> FileColumns:
    """Read the variables of a .mat file that are vectors of numbers.

    Parameters
    ----------
    path
        The file.
    limits
        Sizes beyond which the file is refused.

    Raises
    ------
    RecordingError
        The file is too large, is no .mat file, is damaged, has a variable twice, or needs h5py, which is not
        installed.
    """
    source = str(path)
    content = read_bytes(path, limits.file_bytes, RecordingError)
    if any(content.startswith(HDF5_SIGNATURE, offset) for offset in HDF5_OFFSETS):
        return _read_hdf5(path, limits)
    variables = _variables(content, limits, source)
    check_names([variable.name for variable in variables], source)
    limits.check(0, len(variables), source)
    columns = FileColumns({}, {})
    for variable in variables:
        complaint = variable.complaint or shape_complaint(variable.shape)
        if complaint:
            columns.unusable[variable.name] = complaint
            continue
        limits.check(max(variable.shape), 1, source)
        columns.numeric[variable.name] = np.asarray(variable.values, float)
    return columns


def _variables(content: bytes, limits: ReadLimits, source: str) -> list[Variable]:
    order = BYTE_ORDERS.get(content[126:128])
    try:
        return read_version_5(content, order, 8 * limits.numbers) if order else read_version_4(content)
    except MatError as error:
        raise RecordingError(
            f"{source}: not a readable .mat file ({error}); it may be cut short: copy or save it again"
        ) from None


def _read_hdf5(path: Path, limits: ReadLimits) -> FileColumns:
    if importlib.util.find_spec("h5py") is None:
        raise RecordingError(
            f"{path}: a MATLAB 7.3 file needs h5py: pip install h5py; or save it with -v7 in MATLAB"
        )
    return isolated_columns("hdf5", path, limits)
