"""A calibration on motion that never reverses says so, and claims nothing of friction apart from a load."""

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


def test_a_ramp_leaves_friction_and_load_as_open_as_before() -> None:
    found = calibrated(ramp)
    assert {name for group in found.collinear_sets for name in group.members} == {"coulomb", "offset"}
    (warning,) = found.warnings
    assert "moves one way only" in warning
    assert "coulomb and offset are known no better than before" in warning
    # Of the logarithm, within the factor that is searched.
    assert found.actuator.baseline is not None
    assert found.actuator.baseline.deviations["coulomb"] >= math.log(WIDEST_FACTOR)
    assert not found.parameters["coulomb"].identifiable


@pytest.mark.parametrize("commands", [(there_and_back,), (ramp, opposite)])
def test_a_reversal_separates_them(commands: tuple[Command, ...]) -> None:
    found = calibrated(*commands)
    for name, true in {"coulomb": 0.08, "offset": 0.03}.items():
        one = found.parameters[name]
        assert one.identifiable
        assert abs(one.value - true) < 4 * one.standard_error
        assert one.standard_error < 0.1 * true
    assert found.warnings == ()


def test_what_does_not_act_alike_keeps_its_standard_error() -> None:
    found = calibrated(ramp, free=("coulomb",))
    assert found.warnings == ()
    assert abs(found.parameters["coulomb"].value - 0.11) < 0.05
    assert found.parameters["coulomb"].identifiable
