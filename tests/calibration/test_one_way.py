"""Calibration on motion without reversal: a warning, and friction confounded with the load."""

import math

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Command
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.arrays import Array
from emaphm.calibration import Calibration, calibrate
from emaphm.estimation.space.parameter_variation import WIDEST_FACTOR
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

UNIT = with_lumped_parameters(THESIS, {"coulomb": 0.08, "offset": 0.03})
COLUMNS = ("time_s", "command_rad", "current_A", "position_rad")


def ramp(times: Array) -> Array:
    return np.where(times >= 0.02, 0.05 * (times - 0.02), 0.0)


def there_and_back(times: Array) -> Array:
    return np.where(times >= 0.02, 0.05 * (0.1 - np.abs(times - 0.12)), 0.0)


def calibrated(*commands: Command, free: tuple[str, ...] = ("coulomb", "offset")) -> Calibration:
    days = []
    for seed, command in enumerate(commands):
        whole = simulate(UNIT, command, model="averaged", noise=0.05, duration=0.22, seed=seed)
        days.append(Recording({name: whole[name] for name in COLUMNS}))
    return calibrate(days, THESIS, free, nuisances=(), max_corrections=0, workers=1)


def opposite(times: Array) -> Array:
    return -ramp(times)


def test_on_a_ramp_friction_and_load_are_not_identifiable() -> None:
    calibration = calibrated(ramp)
    assert {name for group in calibration.collinear_sets for name in group.members} == {"coulomb", "offset"}
    (warning,) = calibration.warnings
    assert "moves one way only" in warning
    assert "coulomb and offset are known no better than before" in warning
    # Standard deviation of the logarithm, at the factor of the search range.
    assert calibration.actuator.baseline is not None
    assert calibration.actuator.baseline.deviations["coulomb"] >= math.log(WIDEST_FACTOR)
    assert not calibration.parameters["coulomb"].identifiable


@pytest.mark.parametrize("commands", [(there_and_back,), (ramp, opposite)])
def test_a_reversal_separates_friction_and_load(commands: tuple[Command, ...]) -> None:
    calibration = calibrated(*commands)
    for name, true in {"coulomb": 0.08, "offset": 0.03}.items():
        parameter = calibration.parameters[name]
        assert parameter.identifiable
        assert abs(parameter.value - true) < 4 * parameter.standard_error
        assert parameter.standard_error < 0.1 * true
    assert calibration.warnings == ()


def test_friction_alone_keeps_its_standard_error_on_a_ramp() -> None:
    calibration = calibrated(ramp, free=("coulomb",))
    assert calibration.warnings == ()
    assert abs(calibration.parameters["coulomb"].value - 0.11) < 0.05
    assert calibration.parameters["coulomb"].identifiable
