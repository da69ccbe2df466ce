"""End stops: the position of the user never passes one, and leaves it when the torque reverses."""

import numpy as np
import pytest

from emaphm.actuator import Faults, Sine, Step
from emaphm.simulation import MODELS, Model
from simulation.rig import altered, record

EACH_MODEL = pytest.mark.parametrize("model", MODELS.values(), ids=list(MODELS))
LOW, HIGH = -2e-3, 3e-3
NARROW = altered(mechanics={"end_stops": (LOW, HIGH)})


@EACH_MODEL
@pytest.mark.parametrize("k2", [0.0, 1.0])
def test_the_position_stops_at_both_end_stops(model: Model, k2: float) -> None:
    signals = record(
        model, Sine(8e-3, 10.0), NARROW, faults=Faults(backlash=k2), duration=0.2, interval=model.step
    )
    position, speed = signals["position_rad"], signals["speed_rad_s"]
    assert position.max() == pytest.approx(HIGH, rel=1e-14)
    assert position.min() == pytest.approx(LOW, rel=1e-14)
    for stop, outward in ((HIGH, 1), (LOW, -1)):
        at_stop = np.abs(position - stop) < 1e-12
        pushed = at_stop & (outward * signals["torque_Nm"] > 0) & np.roll(at_stop, 1)
        assert pushed.sum() > 0.01 / model.step
        assert not speed[pushed].any()
        # The motor rests half the gap beyond; at 10 Hz the command reverses 25 ms after the stop is reached.
        beyond = 5e-3 * (1 + 9 * k2) / 2 * outward
        assert signals["angle_rad"][pushed] == pytest.approx(stop * 500 + beyond, rel=1e-12)
    # The position moved from the upper to the lower stop and returned.
    changes = np.diff(np.sign(position - 0.5 * (LOW + HIGH)))
    assert np.count_nonzero(changes) >= 3


@EACH_MODEL
def test_without_end_stops_the_position_follows_the_same_command(model: Model) -> None:
    signals = record(model, Sine(8e-3, 10.0), altered(mechanics={"end_stops": None}), duration=0.1)
    assert signals["position_rad"].max() > 2 * HIGH
    assert signals["position_rad"].min() < 2 * LOW


@EACH_MODEL
def test_end_stops_limit_the_position_of_the_user_for_any_gear(model: Model) -> None:
    geared = altered(mechanics={"end_stops": (-1e-2, 1e-2), "gear_ratio": 1 / 50})
    signals = record(model, Step(-1.0), geared, duration=0.1)
    assert signals["position_rad"][-1] == pytest.approx(-1e-2, rel=1e-14)
    assert signals["speed_rad_s"][-1] == 0
