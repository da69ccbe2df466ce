"""A run that begins within a motion, against a run that reached the same state from rest."""

import numpy as np
import pytest

from emaphm.actuator import Actuator, Command, Faults, Ramp, Sine
from emaphm.arrays import Array
from emaphm.simulation import AVERAGED, REFERENCE, Initial, Model
from simulation.rig import altered, record, rms

PMSM = altered(Actuator.pmsm(), mechanics={"backlash": 0.0})
DRIVES = {"foc": PMSM, "six-step": altered(PMSM, drive={"kind": "six-step"})}


@pytest.mark.parametrize("model", [REFERENCE, AVERAGED], ids=["reference", "averaged"])
@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("faults", [Faults(), Faults(short_b=0.3)], ids=["healthy", "short"])
def test_a_run_from_within_a_motion_agrees_with_the_whole_run(
    model: Model, drive: str, faults: Faults
) -> None:
    actuator, begins, rows, interval = DRIVES[drive], 200, 50, 1e-4

    def command(time: Array) -> Array:
        return np.asarray(4e-3 * np.sin(2 * np.pi * 10 * time))

    whole = record(
        model, command, actuator, faults=faults, duration=0.025, interval=interval, sampling="instant"
    )
    start = Initial(
        whole["position_rad"][begins] / actuator.mechanics.gear_ratio, whole["speed_rad_s"][begins]
    )
    later = record(
        model,
        lambda time: command(time + begins * interval),
        actuator,
        faults=faults,
        duration=rows * interval,
        interval=interval,
        sampling="instant",
        start=start,
    )
    assert abs(start.speed) > 50
    for name, limit in (("current_A", 0.1), ("speed_rad_s", 0.005)):
        # Without current and voltage at the start, the differences are 0.23 to 0.35 and 0.014 to 0.022.
        remaining = whole[name][begins:]
        assert rms(later[name] - remaining) < limit * rms(remaining), name


@pytest.mark.parametrize(
    ("controller", "command", "limit"),
    [
        # In a ramp, the laws are exact.
        ({"speed_feedforward": 0.7}, Ramp(0.1), 0.01),
        ({"command_lag": 4e-3, "speed_feedforward": 0.5}, Ramp(0.1), 0.01),
        # Without the values of the laws at the start, the differences are 0.3 and 0.6 of the rms current.
        ({"speed_lag": 1e-3}, Sine(0.02, 4.0), 0.1),
        ({"command_lag": 3e-3}, Sine(0.02, 4.0), 0.1),
    ],
)
def test_the_controller_has_followed_the_motion_before_the_start(
    controller: dict[str, float], command: Command, limit: float
) -> None:
    actuator = altered(Actuator.load("thesis"), mechanics={"backlash": 0.0}, controller=controller)
    begins, rows, interval = 1000, 50, 2e-4

    def recorded(driven: Command, samples: int, start: Initial) -> dict[str, Array]:
        return record(
            AVERAGED,
            driven,
            actuator,
            duration=samples * interval,
            interval=interval,
            sampling="instant",
            start=start,
        )

    whole = recorded(command, begins + rows, Initial())
    ratio = actuator.mechanics.gear_ratio
    start = Initial(whole["position_rad"][begins] / ratio, whole["speed_rad_s"][begins])
    later = recorded(lambda time: command(time + begins * interval), rows, start)
    # The current itself needs some rows after the start.
    remaining = whole["current_A"][begins + 5 :]
    assert rms(later["current_A"][5:] - remaining) < limit * rms(whole["current_A"])
