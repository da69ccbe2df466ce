"""Simulated recordings for uploads, different for each number."""

import io

import numpy as np
import polars as pl

from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.simulated_recording import simulate

CHANNELS = ("time_s", "command_rad", "position_rad", "speed_rad_s", "angle_rad", "current_A", "voltage_V")


def flight() -> pl.DataFrame:
    """Return a recording of 0.2 s of a worn actuator."""
    simulated = simulate(
        Actuator.thesis(),
        Chirp(5e-3, stop_hz=15.0, duration=0.2),
        faults=Faults(friction=0.3),
        model="averaged",
        duration=0.2,
        noise=0.01,
    )
    return pl.DataFrame({name: simulated[name] for name in CHANNELS if name in simulated.names})


def as_csv(table: pl.DataFrame, number: int) -> bytes:
    """Return the recording as CSV, with noise that is unique to `number`."""
    noise = 1e-3 * np.random.default_rng(number).standard_normal(table.height)
    buffer = io.BytesIO()
    table.with_columns(current_A=table["current_A"] + noise).write_csv(buffer)
    return buffer.getvalue()
