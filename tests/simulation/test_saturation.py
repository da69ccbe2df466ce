"""A torque constant that falls with the current: closed forms, a differential equation, and all drives."""

import math
from typing import Any

import numpy as np
import pytest

from emaphm.actuator import Actuator, Chirp, Step
from emaphm.arrays import Array
from emaphm.simulation import AVERAGED, REFERENCE, Initial, Model, monitor
from emaphm.simulation.laws.saturation import flux_left
from simulation.rig import FREE, LOCKED, SERVO, THESIS, altered, errors_of_a_dc_motor, record, rms

PMSM = Actuator.pmsm()
V_DC, R_S, L_S, K, J = 48.0, 2.13, 7.2e-4, 0.0752, 2.5e-5


def saturating(actuator: Actuator = THESIS, /, value: float = 0.01, **sections: Any) -> Actuator:
    return altered(actuator, motor={"saturation": value, "torque_limit": None}, **sections)


@pytest.mark.parametrize("value", [0.02, -0.01])
@pytest.mark.parametrize(
    ("model", "bound"),
    [(AVERAGED, 1e-6), (REFERENCE, 0.01), (monitor(), 0.03)],
    ids=lambda value: str(value)[:40],
)
def test_a_stalled_motor_has_the_torque_by_the_saturated_flux(
    model: Model, bound: float, value: float
) -> None:
    start = Initial(rotor_offset=math.radians(30))
    actuator = saturating(THESIS, value, mechanics=LOCKED, controller={"current_limit": 15.0})
    signals = record(model, Step(0.1), actuator, duration=0.02, start=start, interval=1e-3)
    current = signals["current_A"][-1]
    assert abs(current) == pytest.approx(15.0, abs=0.6)
    assert signals["torque_Nm"][-1] == pytest.approx(K * (1 - value * abs(current)) * current, rel=bound)


@pytest.mark.parametrize("value", [0.02, -0.02])
def test_a_dc_motor_with_saturation_agrees_with_its_differential_equation(value: float) -> None:
    duty, viscous = 0.9, 1e-4

    def slopes(t: float, x: Array) -> list[float]:  # noqa: ARG001
        current, speed = x
        k = K * max(1 - value * abs(current), 0.1)
        return [(duty * V_DC - R_S * current - k * speed) / L_S, (k * current - viscous * speed) / J]

    actuator = saturating(
        THESIS,
        value,
        mechanics=FREE | {"viscous_motor": viscous, "gear_ratio": 1e-9},
        drive={"kind": "voltage"},
        controller=SERVO["controller"],
    )
    errors = np.array(errors_of_a_dc_motor(actuator, duty, slopes, 0.03)) / (V_DC / R_S)
    # Without the law, the error of the current is up to 20 %.
    assert errors[0] < 0.01
    assert errors[1] < 0.3 * errors[0]


def test_the_flux_has_a_lower_limit_at_any_current() -> None:
    assert float(flux_left(0.02, 10.0)) == pytest.approx(0.8)
    assert float(flux_left(0.02, -1e6)) == pytest.approx(0.1)
    assert float(flux_left(-0.02, 10.0)) == pytest.approx(1.2)


@pytest.mark.parametrize(
    ("base", "drive"),
    [
        (THESIS, {}),
        (PMSM, {"drive": {"kind": "six-step"}}),
        (PMSM, {}),
    ],
    ids=["hysteresis", "six-step", "foc"],
)
def test_saturation_has_the_same_effect_in_both_models(base: Actuator, drive: dict[str, Any]) -> None:
    def currents(actuator: Actuator) -> Array:
        runs = [record(model, Chirp(), actuator, duration=0.3) for model in (AVERAGED, REFERENCE)]
        return np.array([signals["current_A"] for signals in runs])

    without, with_law = currents(altered(base, **drive)), currents(saturating(base, 0.05, **drive))
    of_averaged, of_reference = with_law - without
    assert rms(of_reference) > 0.05 * rms(without[1])
    assert rms(of_averaged - of_reference) < 0.3 * rms(of_reference) + rms(without[0] - without[1])
    assert rms(with_law[0] - with_law[1]) < 1.2 * rms(without[0] - without[1]) + 0.02
