"""Voltage drop of the inverter: closed forms, a differential equation, and all drives."""

import math
from typing import Any

import numpy as np
import pytest

from emaphm.actuator import Actuator, Chirp, Step
from emaphm.arrays import Array
from emaphm.simulation import AVERAGED, REFERENCE, Initial, Model
from simulation.rig import FREE, LOCKED, SERVO, THESIS, altered, errors_of_a_dc_motor, record, rms

PMSM = Actuator.pmsm()
V_DC, R_S, L_S, K, J = 48.0, 2.13, 7.2e-4, 0.0752, 2.5e-5
KNEE_A = 0.02 * THESIS.controller.current_limit
DROP = 1.5


def losing(actuator: Actuator = THESIS, /, kind: str = "hysteresis", **sections: Any) -> Actuator:
    return altered(actuator, drive={"kind": kind, "voltage_drop": DROP}, **sections)


@pytest.mark.parametrize("duty", [0.5, -0.2])
def test_a_stalled_servo_has_the_current_by_the_reduced_voltage(duty: float) -> None:
    signals = record(AVERAGED, Step(duty), losing(kind="voltage", mechanics=LOCKED, **SERVO), duration=0.02)
    reduced = duty * V_DC - math.copysign(DROP, duty)
    assert signals["current_A"][-1] == pytest.approx(reduced / R_S, rel=1e-6)
    assert signals["voltage_V"][-1] == pytest.approx(duty * V_DC, rel=1e-6)


@pytest.mark.parametrize(("model", "bound"), [(AVERAGED, 1e-3), (REFERENCE, 0.01)], ids=lambda x: str(x)[:30])
def test_a_stalled_motor_at_the_supply_limit_has_the_reduced_current(model: Model, bound: float) -> None:
    start = Initial(rotor_offset=math.radians(30))
    actuator = losing(mechanics=LOCKED, controller={"current_limit": 100.0})
    signals = record(model, Step(0.1), actuator, duration=0.02, start=start, interval=1e-3)
    assert signals["current_A"][-1] == pytest.approx((V_DC - DROP) / R_S, rel=bound)


def test_a_dc_motor_with_voltage_drop_agrees_with_its_differential_equation() -> None:
    duty, viscous = -0.4, 1e-4

    def slopes(t: float, x: Array) -> list[float]:  # noqa: ARG001
        current, speed = x
        lost = DROP * min(max(current / KNEE_A, -1.0), 1.0)
        return [
            (duty * V_DC - lost - R_S * current - K * speed) / L_S,
            (K * current - viscous * speed) / J,
        ]

    mechanics = FREE | {"viscous_motor": viscous, "gear_ratio": 1e-9}
    actuator = losing(kind="voltage", mechanics=mechanics, **SERVO)
    errors = np.array(errors_of_a_dc_motor(actuator, duty, slopes, 0.06)) / (V_DC / R_S)
    # Without the law, the error is a thirtieth of this current.
    assert errors[0] < 2e-3
    assert errors[1] < 0.3 * errors[0]


@pytest.mark.parametrize(
    ("base", "kind", "channel"),
    [(THESIS, "hysteresis", "voltage_V"), (PMSM, "six-step", "voltage_V"), (PMSM, "foc", "voltage_q_V")],
    ids=["hysteresis", "six-step", "foc"],
)
def test_the_commanded_voltage_is_higher_by_the_drop(base: Actuator, kind: str, channel: str) -> None:
    without = altered(base, drive={"kind": kind})
    for model in (AVERAGED, REFERENCE):
        plain, lossy = (
            record(model, Chirp(), actuator, duration=0.3)
            for actuator in (without, losing(without, kind=kind))
        )
        difference = lossy[channel] - plain[channel]
        # Rows with a constant sign of the current, which the current loop restores.
        steady = np.abs(plain["current_A"]) > 1.5
        signed = np.mean(difference[steady] * np.sign(plain["current_A"][steady]))
        # With three sines, the mean of V_d/2 (sgn a, sgn b, sgn c) in q is 2 √3/π of the drop of a pair.
        share = 1.0 if kind != "foc" else 2 * math.sqrt(3) / math.pi
        assert signed == pytest.approx(share * DROP, rel=0.02)
        assert rms(lossy["current_A"] - plain["current_A"]) < 0.25 * rms(plain["current_A"])
