"""Batches that record all comparable channels, and a load proportional to the position of the user."""

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

from emaphm import threads
from emaphm.actuator import Actuator, Chirp, Faults, Sine, Step
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.simulated_recording import simulate
from emaphm.simulation import (
    AVERAGED,
    MODELS,
    OBSERVABLE,
    REFERENCE,
    Initial,
    Inputs,
    Model,
    Plant,
    monitor,
    observe_batch,
    run,
    simulate_batch,
)
from emaphm.simulation.engine import running
from simulation import scalar_reference, scalar_winding
from simulation.rig import FREE, altered, record

THESIS = Actuator.thesis()
EACH_MODEL = pytest.mark.parametrize("model", MODELS.values(), ids=list(MODELS))
FAULTS = np.random.default_rng(5).random((20, 8)) * np.array([1, 1, 0.7, 0.7, 0.7, 1, 1, 1])


@EACH_MODEL
def test_a_batch_observes_the_channels_of_single_runs(model: Model) -> None:
    inputs = Inputs.of(Chirp(), samples=100, interval=2e-4, step=model.step)
    plant = Plant.of(THESIS, FAULTS[:3])
    batch = observe_batch(model, plant, inputs).transpose(1, 0, 2)
    assert batch.shape == (len(OBSERVABLE), 3, 100)
    for i in range(3):
        alone = run(model, Plant.of(THESIS, FAULTS[i]), inputs)
        for channel, name in zip(batch, OBSERVABLE, strict=True):
            # The same laws with another order of additions; switching may amplify rounding over 20 ms.
            np.testing.assert_allclose(channel[i], alone[name], rtol=0, atol=1e-6)


@EACH_MODEL
def test_selected_channels_equal_those_of_all(model: Model) -> None:
    inputs = Inputs.of(Chirp(), samples=100, interval=2e-4, step=model.step)
    plant = Plant.of(THESIS, FAULTS)
    all_channels = observe_batch(model, plant, inputs)
    selected = observe_batch(model, plant, inputs, channels=("voltage_V", "current_A"))
    # Rounding of the same laws, compiled with and without the other channels.
    np.testing.assert_allclose(selected, all_channels[:, [1, 0]], rtol=0, atol=1e-6)
    currents = simulate_batch(model, THESIS, FAULTS, inputs)
    np.testing.assert_allclose(currents, all_channels[:, 0], rtol=0, atol=1e-6)


@EACH_MODEL
def test_the_number_of_workers_changes_no_bit(model: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    pools: list[int] = []

    class Counted(ThreadPoolExecutor):
        def __init__(self, workers: int) -> None:
            pools.append(workers)
            super().__init__(workers)

    monkeypatch.setattr(threads, "ThreadPoolExecutor", Counted)
    # A batch this short would be computed without threads otherwise.
    monkeypatch.setattr(running, "WORTH_A_THREAD", 0)
    inputs = Inputs.of(Chirp(), samples=50, interval=2e-4, step=model.step)
    plant = Plant.of(THESIS, np.tile(FAULTS, (2, 1)))
    one, two, three = (observe_batch(model, plant, inputs, workers=workers) for workers in (1, 2, 3))
    assert pools == [2, 3]
    np.testing.assert_array_equal(one, two)
    np.testing.assert_array_equal(one, three)


@pytest.mark.parametrize("model", ["averaged", "reference"])
def test_the_torque_of_the_motor_balances_a_hinge_moment(model: str) -> None:
    hinge, position = 60.0, 5e-3
    loaded = with_lumped_parameters(THESIS, {"hinge": hinge, "coulomb": 1e-6, "static": 1e-6})
    held = simulate(loaded, Step(position), model=model, duration=0.5)
    torque = hinge * held["position_rad"][-500:].mean()
    current = held["current_A"][-500:].mean()
    # k i = hinge × position; by backlash the shaft oscillates within its gap, a percent of the torque.
    assert torque == pytest.approx(hinge * position, rel=0.02)
    assert current * THESIS.motor.torque_constant == pytest.approx(torque, rel=0.03)


def test_a_hinge_moment_of_0_has_no_effect() -> None:
    plain, none = (
        simulate(actuator, Chirp(), faults=Faults(friction=0.3), model="averaged")
        for actuator in (THESIS, with_lumped_parameters(THESIS, {"hinge": 0.0}))
    )
    np.testing.assert_array_equal(plain["current_A"], none["current_A"])


def sine(t: float) -> float:
    return float(Sine(8e-3, 15.0)(np.array([t]))[0])


HINGED = altered(mechanics={"hinge": 40.0, "offset": 0.02})
"""Actuator with a load by the stiffness of 0.32 N·m at 8 mrad, three times the friction."""


@pytest.mark.parametrize(
    ("model", "form"),
    [(AVERAGED, {"averaged": True}), (monitor(), {"averaged": False, "shorts": "printed"})],
    ids=["averaged", "monitor"],
)
def test_models_with_one_winding_have_the_hinge_moment_of_the_scalar_model(
    model: Model, form: dict[str, Any]
) -> None:
    faults, duration = Faults.from_vector(FAULTS[0]), 0.1
    steps = round(duration / model.step)
    expected = scalar_winding.simulate(HINGED, faults, sine, steps, model.step, **form)
    signals = record(model, Sine(8e-3, 15.0), HINGED, faults=faults, duration=duration, interval=model.step)
    for name, values in expected.items():
        # As in test_oracles: the error of the carried cos and sin of the rotor over 0.1 s.
        np.testing.assert_allclose(
            signals[name], values, rtol=0, atol=1e-8 * np.abs(values).max(), err_msg=name
        )


def test_the_reference_model_has_the_hinge_moment_of_the_scalar_model() -> None:
    faults, steps = Faults.from_vector(FAULTS[0]), 10_000
    expected = scalar_reference.simulate(HINGED, faults, sine, steps)
    signals = record(REFERENCE, Sine(8e-3, 15.0), HINGED, faults=faults, duration=steps * 1e-6, interval=1e-6)
    for name, values in expected.items():
        # As in test_oracles: only rounding, if all legs switch in the same step.
        np.testing.assert_allclose(
            signals[name], values, rtol=0, atol=1e-10 * np.abs(values).max(), err_msg=name
        )


def test_a_hinge_moment_acts_as_a_spring() -> None:
    # J dw/dt = -hinge × gear ratio × angle, without friction and backlash and with a negligible motor torque.
    swinging = altered(mechanics=FREE | {"hinge": 50.0, "backlash": 0.0}, controller={"current_limit": 1e-9})
    ratio, inertia = swinging.mechanics.gear_ratio, swinging.mechanics.inertia
    pulsation = np.sqrt(50.0 * ratio / inertia)
    swing = record(AVERAGED, Step(0.0), swinging, start=Initial(1.0), sampling="instant")
    t = swing["time_s"]
    assert t[-1] * pulsation > 4 * 2 * np.pi
    # A shaft that reverses is at rest at the end of the step: a delay of up to one step per reversal.
    reversals = t[-1] * pulsation / np.pi
    late = (reversals + 1) * pulsation * AVERAGED.step
    np.testing.assert_allclose(swing["angle_rad"], np.cos(pulsation * t), rtol=0, atol=late)
