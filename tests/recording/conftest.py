"""Fixtures of the tests of recordings: actuators, columns, refusals and measured files."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from emaphm.actuator import Actuator
from emaphm.actuator.channels import Channels
from emaphm.actuator.parameters import Controller, Mechanics, Motor
from emaphm.errors import EmaphmError

Columns = dict[str, NDArray[np.float64]]
Refusal = Callable[[Callable[[], object]], str]


@pytest.fixture
def thesis() -> Actuator:
    return Actuator.thesis()


@pytest.fixture
def emps() -> Actuator:
    """Return the EMPS rig by its data set: linear, commanded in volts, without end stops."""
    return Actuator(
        name="emps",
        coordinates="linear",
        controller=Controller(
            position_gain=160.18, speed_gain=243.45 * 35.1507, current_limit=10.0, torque_constant=35.1507
        ),
        motor=Motor(torque_constant=35.1507),
        mechanics=Mechanics(
            inertia_motor=95.1089,
            viscous_motor=203.5034,
            static_friction_motor=20.3935,
            dynamic_friction_motor=20.3935,
            offset=-3.1648,
            gear_ratio=1.0,
        ),
        channels=Channels(
            sampling="instant", time_s="t", command_rad="qg", position_rad="qm", current_A="vir"
        ),
    )


def half_a_second() -> Columns:
    """Return half a second of a healthy thesis actuator, in closed form."""
    time = np.arange(2500) / 5000.0
    swing = 2 * np.pi * 4.0 * time
    return {
        "time_s": time,
        "command_rad": 5e-3 * np.sin(swing),
        "position_rad": 5e-3 * np.sin(swing - 0.05),
        "speed_rad_s": 2.5 * 8 * np.pi * np.cos(swing - 0.05),
        "current_A": 1.5 * np.sign(np.cos(swing)) - 0.4 * np.sin(swing),
        "temperature_K": np.full(time.size, 293.15),
    }


@pytest.fixture
def columns() -> Columns:
    return half_a_second()


@pytest.fixture
def refusal() -> Refusal:
    """Return a function that checks that an action is refused in one line, and returns the message."""

    def message(action: Callable[[], object]) -> str:
        with pytest.raises(EmaphmError) as caught:
            action()
        text = str(caught.value)
        assert text
        assert "\n" not in text
        return text

    return message


def measured_file(*parts: str) -> Path:
    """Return the path of measured data; tests that need it are skipped if it is missing."""
    beside = Path(__file__).resolve().parents[3] / "shared" / "data"
    path = Path(os.environ.get("EMAPHM_DATA", beside)).joinpath(*parts)
    if not path.exists():
        pytest.skip(f"the measured data are not at {path}; set EMAPHM_DATA to the folder that holds them")
    return path


@pytest.fixture
def emps_file() -> Path:
    """Return the path of the measured EMPS data."""
    return measured_file("emps", "DATA_EMPS.mat")


@pytest.fixture
def xl330_folder() -> Path:
    """Return the folder with the logs of a real servo."""
    return measured_file("xl330")
