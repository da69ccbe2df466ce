"""PID position control with feedforward around the speed loop, against solve_ivp."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from emaphm.actuator import Faults, Sine
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.arrays import Array
from emaphm.simulation import AVERAGED, Inputs, Plant, run
from simulation.rig import FREE, altered, record

INERTIA, VISCOUS, RATIO = 2.5e-5, 1e-4, 1 / 500
GAIN, SPEED_GAIN = 2e4, 0.02
AMPLITUDE, OMEGA = 5e-3, 2 * math.pi * 10.0


@pytest.mark.parametrize(
    ("integral", "derivative", "feedforward", "feedback", "lag"),
    [
        (50.0, 0.0, 0.0, 1.0, 0.0),
        (0.0, 2e-3, 0.0, 1.0, 0.0),
        (0.0, 0.0, 0.8, 1.0, 0.0),
        (0.0, 2e-3, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0, 1.0, 5e-3),
        (50.0, 1e-3, 0.5, 0.9, 5e-3),
    ],
    ids=["PI", "PD", "feed-forward", "PD without speed loop", "lag", "all"],
)
def test_the_position_loop_moves_as_its_differential_equation(
    integral: float, derivative: float, feedforward: float, feedback: float, lag: float
) -> None:
    actuator = altered(
        electrical=None,
        mechanics=FREE | {"viscous_motor": VISCOUS, "backlash": 0.0},
        motor={"torque_limit": None},
        controller={
            "position_gain": GAIN,
            "speed_gain": SPEED_GAIN,
            "position_integral_gain": integral,
            "position_derivative_gain": derivative,
            "speed_feedforward": feedforward,
            "speed_feedback": feedback,
            "command_lag": lag,
            "speed_limit": None,
            "current_limit": 1e9,
        },
    )

    def commanded(t: float) -> tuple[float, float]:
        """Return the command and its rate: a sine from time 0 after a first-order lag T, in closed form.

        c = A (sin ωt - ωT (cos ωt - exp(-t/T))) / (1 + (ωT)²)
        """
        late = OMEGA * lag
        gone = math.exp(-t / lag) if lag else 0.0
        sine, cosine = math.sin(OMEGA * t), math.cos(OMEGA * t)
        scale = AMPLITUDE / (1 + late**2)
        return scale * (sine - late * (cosine - gone)), scale * OMEGA * (cosine + late * sine - gone)

    def torque(t: float, theta: float, w: float, summed: float) -> float:
        command, rate = commanded(t)
        error = command - RATIO * theta
        demand = GAIN * (error + integral * summed + derivative * (rate - RATIO * w))
        return SPEED_GAIN * (demand + feedforward * rate / RATIO - feedback * w)

    def slopes(t: float, y: Array) -> list[float]:
        theta, w, summed = y
        accelerating = torque(t, theta, w, summed) - VISCOUS * w
        return [w, accelerating / INERTIA, commanded(t)[0] - RATIO * theta]

    errors = []
    for step in (5e-5, 1.25e-5):
        signals = record(
            AVERAGED,
            Sine(AMPLITUDE, OMEGA / (2 * math.pi)),
            actuator,
            duration=0.2,
            interval=1e-3,
            step=step,
            sampling="instant",
        )
        t = signals["time_s"]
        end = solve_ivp(slopes, (0, t[-1]), [0.0, 0.0, 0.0], "LSODA", t, rtol=1e-10, atol=1e-12)
        theta, w, summed = end.y
        expected_torque = np.array([torque(*state) for state in zip(t, theta, w, summed, strict=True)])
        errors.append(
            [
                np.abs(signals["position_rad"] - RATIO * theta).max() / (RATIO * np.abs(theta).max()),
                np.abs(signals["speed_rad_s"] - w).max() / np.abs(w).max(),
                np.abs(signals["torque_Nm"] - expected_torque)[1:].max() / np.abs(expected_torque).max(),
            ]
        )
    # Explicit steps: a loop of bandwidth GAP / J = 800 /s is half a step late, 2 %; the torque of the first
    # step, at which the rate of the command jumps, does not include the rate.
    assert max(errors[0]) < 0.06
    assert np.all(np.array(errors[1]) < 0.35 * np.array(errors[0]) + 1e-6)


@pytest.mark.parametrize(
    "parameter",
    [
        {"position_integral_gain": 50.0},
        {"position_derivative_gain": 2e-3},
        {"speed_feedforward": 0.8},
        {"speed_feedback": 0.8},
        {"command_lag": 5e-3},
    ],
    ids=lambda parameter: next(iter(parameter)),
)
def test_a_given_parameter_acts_like_a_described_one(parameter: dict[str, float]) -> None:
    actuator = altered(electrical=None, controller={"position_gain": GAIN, "speed_gain": SPEED_GAIN})
    described = with_lumped_parameters(actuator, parameter)
    inputs = Inputs.of(Sine(AMPLITUDE, 10.0), samples=100, interval=1e-3, step=5e-5)
    healthy = Faults().vector
    given = run(AVERAGED, Plant.of(actuator, healthy, parameter), inputs)["position_rad"]
    np.testing.assert_array_equal(given, run(AVERAGED, Plant.of(described, healthy), inputs)["position_rad"])
    assert np.any(given != run(AVERAGED, Plant.of(actuator, healthy), inputs)["position_rad"])
