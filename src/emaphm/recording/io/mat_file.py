"""MATLAB .mat files: versions 4 to 7 through SciPy, 7.3 (which is HDF5) through h5py."""

import importlib
import io
import warnings
from typing import Any

import numpy as np

from emaphm.errors import RecordingError
from emaphm.recording.io.table import Table, reason

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
HDF5_OFFSETS = (0, 512)
"""Where the signature stands: MATLAB puts a header of its own before it."""


def read_mat(content: bytes, source: str) -> Table:
    """Read the variables of a .mat file that are vectors of numbers.

    Parameters
    ----------
    content
        The file's bytes.
    source
        Its name, for errors.

    Raises
    ------
    RecordingError
        It is no .mat file, is damaged, has a variable twice, or needs h5py, which is not installed.
    """
    is_hdf5 = any(content.startswith(HDF5_SIGNATURE, offset) for offset in HDF5_OFFSETS)
    variables = _load_hdf5(content, source) if is_hdf5 else _load(content, source)
    table = Table({}, {})
    for name, value in variables.items():
        complaint = _complaint(value)
        if complaint:
            table.unusable[name] = complaint
        else:
            table.numeric[name] = np.asarray(value, float).ravel()
    return table


def _load(content: bytes, source: str) -> dict[str, Any]:
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadWarning

    try:
        with warnings.catch_warnings():
            # SciPy warns of a variable that is there twice, and would take the later one.
            warnings.simplefilter("error", MatReadWarning)
            variables = loadmat(io.BytesIO(content))  # type: ignore[arg-type] # its stubs forget file objects
    except MatReadWarning as warning:
        what = reason(warning).partition(" in stream")[0]
        raise RecordingError(f"{source}: {what}; save each variable once") from None
    except Exception as error:  # noqa: BLE001 - SciPy's parser fails in any way on foreign bytes
        raise _unreadable(error, source) from None
    return {name: value for name, value in variables.items() if not name.startswith("__")}


def _load_hdf5(content: bytes, source: str) -> dict[str, Any]:
    try:
        h5py: Any = importlib.import_module("h5py")
    except ImportError:
        raise RecordingError(
            f"{source}: a MATLAB 7.3 file needs h5py: pip install h5py; or save it with -v7 in MATLAB"
        ) from None
    try:
        with h5py.File(io.BytesIO(content), "r") as file:
            return {name: _hdf5_value(item) for name, item in file.items() if not name.startswith("#")}
    except (OSError, RuntimeError, KeyError, ValueError) as error:
        raise _unreadable(error, source) from None


def _hdf5_value(item: Any) -> Any:
    # Text is stored as numbers there, and only this attribute tells.
    is_text = item.attrs.get("MATLAB_class") in {b"char", "char"}
    return item[()] if hasattr(item, "shape") and not is_text else None


def _unreadable(error: Exception, source: str) -> RecordingError:
    return RecordingError(
        f"{source}: not a readable .mat file ({reason(error)}); it may be cut short: copy or save it again"
    )


def _complaint(value: Any) -> str | None:
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiu":
        kind = (
            "a struct" if getattr(value, "dtype", None) is not None and value.dtype.names else "not numeric"
        )
        return f"is {kind}; save it as a vector of real numbers under this name"
    if value.size == 1:
        return "is a single number; save one value for each sample"
    if value.size == 0 or value.size != max(value.shape):
        shape = " × ".join(map(str, value.shape))
        return f"is an array of {shape}; save it as a vector, one value for each sample"
    return None
