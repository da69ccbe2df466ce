"""Each model against an independent scalar implementation, written only from docs/physics.md."""

from typing import Any

import numpy as np
import pytest

from emaphm.actuator import Actuator, Chirp, Command, Faults, Sine, Step
from emaphm.arrays import Array
from emaphm.simulation import AVERAGED, REFERENCE, Initial, Model, monitor
from simulation import scalar_reference, scalar_winding
from simulation.rig import SHORTED, THESIS, altered, record

DRAWN = np.random.default_rng(2019).random((3, 8)) * SHORTED
PID = altered(
    controller={"integral_gain": 1.0, "derivative_gain": 1e-6, "speed_lag": 2e-4},
    motor={"torque_lag": 1e-4},
    mechanics={"offset": 0.02},
)
NARROW = altered(mechanics={"end_stops": (-2e-3, 1e-3)})


def scalar(command: Command) -> Any:
    return lambda t: float(command(np.array([t]))[0])


@pytest.mark.parametrize(
    ("command", "k", "load", "rotor_offset", "actuator"),
    [
        (Sine(5e-3, 10.0), Faults().vector, 0.0, 0.0, THESIS),
        (Step(2e-3), DRAWN[0], 0.05, 1.234, THESIS),
        (Sine(-8e-3, 15.0), DRAWN[1], -0.02, -2.0, THESIS),
        (Sine(8e-3, 15.0), DRAWN[2], 0.0, 0.3, PID),
        (Sine(4e-3, 30.0), Faults().vector, 0.0, 0.0, NARROW),
        (Step(2e-3), np.array([0, 0, 1, 0.2, 0, 0.5, 0.1, 0.5]), 0.0, 0.7, THESIS),  # N at its floor of 0.01
    ],
    ids=["healthy", "faults", "reversed", "PID and lags", "stops", "shorted out"],
)
def test_the_reference_model_agrees_with_the_scalar_model(
    command: Command, k: Array, load: float, rotor_offset: float, actuator: Actuator
) -> None:
    # Long enough to pass several sectors, and to leave the end stop that was reached.
    steps = 20_000 if actuator is NARROW else 10_000
    faults = Faults.from_vector(k)
    expected = scalar_reference.simulate(
        actuator, faults, scalar(command), steps, load=load, rotor_offset=rotor_offset
    )
    signals = record(
        REFERENCE,
        command,
        actuator,
        faults=faults,
        duration=steps * 1e-6,
        interval=1e-6,
        load=load,
        start=Initial(rotor_offset=rotor_offset),
    )
    assert {"time_s", *expected} == set(signals)
    for name, values in expected.items():
        # Only rounding: if all legs switch in the same step, Euler steps keep the
        # difference below some 1e-13 of the largest value (measured); one leg a step later causes 0.06 A.
        np.testing.assert_allclose(
            signals[name], values, rtol=0, atol=1e-10 * np.abs(values).max(), err_msg=name
        )


@pytest.mark.parametrize(
    ("model", "form"),
    [
        (AVERAGED, {"averaged": True}),
        (monitor(), {"averaged": False, "shorts": "printed"}),
        (
            monitor(eccentricity="printed"),
            {"averaged": False, "shorts": "printed", "printed_eccentricity": True},
        ),
        (
            monitor("modulated", "printed"),
            {"averaged": False, "shorts": "modulated", "printed_eccentricity": True},
        ),
    ],
    ids=["averaged", "monitor", "monitor, printed eccentricity", "monitor, modulated and printed"],
)
@pytest.mark.parametrize(
    ("k", "actuator"), [(DRAWN[0], THESIS), (DRAWN[1], PID)], ids=["faults", "PID and lags"]
)
def test_models_with_one_winding_agree_with_the_scalar_model(
    model: Model, form: dict[str, Any], k: Array, actuator: Actuator
) -> None:
    command, faults, duration = Sine(8e-3, 15.0), Faults.from_vector(k), 0.03
    expected = scalar_winding.simulate(
        actuator,
        faults,
        scalar(command),
        round(duration / model.step),
        model.step,
        load=0.03,
        rotor_offset=1.3,
        **form,
    )
    signals = record(
        model,
        command,
        actuator,
        faults=faults,
        duration=duration,
        interval=model.step,
        load=0.03,
        start=Initial(rotor_offset=1.3),
    )
    assert {"time_s", *expected} == set(signals)
    for name, values in expected.items():
        # The carried cos and sin have an error of angle⁶ / 720 per step, 1e-14 at 300 rad/s and 50 µs; the
        # loop amplifies it to 1e-10 A over 2000 steps (measured). A wrong N or sector causes 0.1 A.
        np.testing.assert_allclose(
            signals[name], values, rtol=0, atol=1e-8 * np.abs(values).max(), err_msg=name
        )


def test_modulated_shorts_depend_on_the_sector_without_eccentricity() -> None:
    faults = Faults(short_a=0.6, short_b=0.1, short_c=0.3)
    model, command = monitor("modulated"), Chirp()
    steps = round(0.05 / model.step)
    expected = scalar_winding.simulate(
        THESIS, faults, scalar(command), steps, model.step, averaged=False, shorts="modulated"
    )
    signals = record(model, command, faults=faults, duration=0.05, interval=model.step)
    for name, values in expected.items():
        np.testing.assert_allclose(
            signals[name], values, rtol=0, atol=1e-8 * np.abs(values).max(), err_msg=name
        )
