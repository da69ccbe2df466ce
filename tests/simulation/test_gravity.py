"""A weight on an arm of the user: direction, period and energy of a pendulum."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.simulation import AVERAGED, REFERENCE, Initial, Model
from simulation.rig import FREE, altered, record

INERTIA, WEIGHT = 2.5e-5, 0.1
SMALL_SWINGS = math.sqrt(WEIGHT / INERTIA)


def arm(angle: float = 0.0, gear_ratio: float = 1.0, viscous: float = 0.0) -> Actuator:
    """Return an arm whose weight hangs vertically at the position -angle; the motor has no torque."""
    return altered(
        mechanics=FREE | {"gear_ratio": gear_ratio, "backlash": 0.0, "viscous_motor": viscous},
        controller={"position_gain": 1e-12, "speed_gain": 1e-12, "speed_limit": None},
        motor={"torque_constant": 1e-9},
        weight={"gravity": WEIGHT, "gravity_angle": angle},
    )


def released(
    actuator: Actuator, position: float, duration: float, step: float = 5e-5, model: Model = AVERAGED
) -> dict[str, Array]:
    """Return the motion from rest at a position of the user [rad], with an interval of 0.5 ms."""
    start = Initial(angle=position / actuator.mechanics.gear_ratio)
    return record(
        model,
        lambda t: 0 * t + position,
        actuator,
        duration=duration,
        interval=5e-4,
        step=step,
        start=start,
        sampling="instant",
    )


@pytest.mark.parametrize("model", [AVERAGED, REFERENCE], ids=["averaged", "reference"])
@pytest.mark.parametrize("side", [1, -1])
def test_released_horizontally_the_arm_passes_its_lowest_point_as_a_pendulum(model: Model, side: int) -> None:
    quarter = float(ellipk(0.5)) / SMALL_SWINGS
    signals = released(arm(), side * math.pi / 2, 2 * quarter, model.step, model)
    t, position = signals["time_s"], side * signals["position_rad"]
    assert position[0] == pytest.approx(math.pi / 2, rel=1e-6)
    assert np.all(np.diff(position[1:-2]) < 0)  # down, through the lowest point, and up on the other side
    down = np.interp(0.0, -position, t)
    assert down == pytest.approx(quarter, rel=5e-3)
    assert position[-1] == pytest.approx(-math.pi / 2, abs=0.02)


@pytest.mark.parametrize("amplitude", [0.1, 1.5, 3.0])
def test_the_period_is_that_of_a_pendulum(amplitude: float) -> None:
    expected = 4 * float(ellipk(math.sin(amplitude / 2) ** 2)) / SMALL_SWINGS
    for step in (5e-5, 1.25e-5):
        signals = released(arm(), amplitude, 4.2 * expected, step)
        t, position = signals["time_s"], signals["position_rad"]
        rising = np.flatnonzero((position[:-1] < 0) & (position[1:] >= 0))
        share = -position[rising] / (position[rising + 1] - position[rising])
        times = t[rising] + 5e-4 * share
        period = (times[-1] - times[0]) / (len(times) - 1)
        # Both reversals of a period end with a step at rest, wherever in the step the speed was 0.
        assert -2e-5 * expected < period - expected < 2 * step + 2e-5 * expected


@pytest.mark.parametrize(("angle", "gear_ratio"), [(0.0, 1.0), (0.7, 1.0), (-2.0, 0.1), (0.3, 1 / 500)])
def test_the_motion_agrees_with_another_integrator(angle: float, gear_ratio: float) -> None:
    viscous, duration, position = 1e-4, 0.3, 1.0
    actuator = arm(angle, gear_ratio, viscous)
    for step in (5e-5, 1.25e-5):
        signals = released(actuator, position, duration, step)

        def slopes(_: float, y: Array) -> list[float]:
            theta, w = y
            return [w, (-WEIGHT * math.sin(gear_ratio * theta + angle) - viscous * w) / INERTIA]

        end = solve_ivp(
            slopes, (0, duration), [position / gear_ratio, 0.0], "DOP853", signals["time_s"], rtol=1e-10
        )
        error = np.abs(signals["speed_rad_s"] - end.y[1]).max() / np.abs(end.y[1]).max()
        # Up to one step is lost at each of at most six reversals, at 63 rad/s.
        assert error < 6.5 * SMALL_SWINGS * step


def test_the_energy_of_a_rotating_weight_does_not_drift() -> None:
    # The carried direction must not drift: a rotating weight keeps its energy.
    start = Initial(speed=800.0)
    signals = record(
        AVERAGED, lambda t: 0 * t, arm(), duration=5.0, interval=1e-3, start=start, sampling="instant"
    )
    energy = INERTIA / 2 * signals["speed_rad_s"] ** 2 - WEIGHT * np.cos(signals["angle_rad"])
    # With semi-implicit Euler the energy oscillates by w M Δt / 2 = 2e-3 J of 8 J.
    assert np.ptp(energy) < 5e-3
    assert abs(np.polyfit(signals["time_s"], energy, 1)[0]) < 1e-4
