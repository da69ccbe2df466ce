"""Recordings and descriptions as rigs, spreadsheets and typing errors produce them."""

import io
from collections.abc import Mapping

import numpy as np
import polars as pl
import scipy.io
from numpy.typing import NDArray

from emaphm.actuator import Actuator
from emaphm.actuator.toml import write_toml

Columns = dict[str, NDArray[np.float64]]

PNG = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR" + bytes(range(256)) * 8

THESIS = write_toml(Actuator.thesis())


def columns() -> Columns:
    """Return 0.2 s of a healthy thesis actuator at 1 kHz, in closed form."""
    time = np.arange(200) / 1e3
    swing = 2 * np.pi * 10.0 * time
    return {
        "time_s": time,
        "command_rad": 5e-3 * np.sin(swing),
        "position_rad": 5e-3 * np.sin(swing - 0.05),
        "speed_rad_s": 2.5 * 20 * np.pi * np.cos(swing - 0.05),
        "current_A": 1.5 * np.sign(np.cos(swing)) - 0.4 * np.sin(swing),
    }


def with_value(name: str, row: int, value: float) -> Columns:
    """Return `columns` with one value replaced, or with a gap of five; rows count from 1, as in messages."""
    spoiled = columns()
    spoiled[name][row - 1 : row + (4 if np.isnan(value) else 0)] = value
    return spoiled


def scaled(**factors: float) -> Columns:
    """Return `columns` with some columns in another unit."""
    return {name: values * factors.get(name, 1.0) for name, values in columns().items()}


def without(*names: str) -> Columns:
    return {name: values for name, values in columns().items() if name not in names}


def renamed(old: str, new: str) -> Columns:
    return {new if name == old else name: values for name, values in columns().items()}


def text(table: Mapping[str, NDArray[np.float64]], separator: str = ",", point: str = ".") -> str:
    """Return a table as CSV."""
    rows = zip(*table.values(), strict=True)
    numbers = ([f"{float(value)!r}".replace(".", point) for value in row] for row in rows)
    return "".join(f"{separator.join(row)}\n" for row in (table, *numbers))


def csv(table: Mapping[str, NDArray[np.float64]]) -> bytes:
    return text(table).encode()


def parquet(table: Mapping[str, object]) -> bytes:
    file = io.BytesIO()
    pl.DataFrame(dict(table)).write_parquet(file)
    return file.getvalue()


def mat(table: Mapping[str, object]) -> bytes:
    file = io.BytesIO()
    scipy.io.savemat(file, dict(table))  # type: ignore[arg-type] # its stubs forget file objects
    return file.getvalue()


def thesis_with(old: str, new: str) -> str:
    """Return the TOML text of the thesis actuator with `old` replaced by `new`."""
    if old not in THESIS:
        raise ValueError(f"the description has no '{old}'")
    return THESIS.replace(old, new, 1)
