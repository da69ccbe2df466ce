"""Batches that record every channel which a rig may compare; a load that grows with the user's position."""

import numpy as np
import pytest

from emaphm.actuator import Actuator, Chirp, Faults, Step
from emaphm.actuator.totals import with_totals
from emaphm.rig import simulate
from emaphm.simulation import (
    AVERAGED,
    OBSERVABLE,
    REFERENCE,
    Inputs,
    Model,
    Plant,
    monitor,
    observe_batch,
    run,
    run_batch,
)

THESIS = Actuator.thesis()
FAULTS = np.random.default_rng(5).random((20, 8)) * np.array([1, 1, 0.7, 0.7, 0.7, 1, 1, 1])


@pytest.mark.parametrize("model", [REFERENCE, AVERAGED, monitor()], ids=lambda model: model.name)
def test_a_batch_observes_what_a_single_run_records(model: Model) -> None:
    inputs = Inputs.of(Chirp(), samples=100, interval=2e-4, step=model.step)
    plant = Plant.of(THESIS, FAULTS[:3])
    together = observe_batch(model, plant, inputs)
    assert together.shape == (len(OBSERVABLE), 3, 100)
    for i in range(3):
        alone = run(model, plant.part(i, i + 1), inputs)
        for channel, name in zip(together, OBSERVABLE, strict=True):
            # The same laws in another order of additions; switching may amplify it over 20 ms.
            np.testing.assert_allclose(channel[i], alone[name], rtol=0, atol=1e-6)


def test_the_first_channel_is_the_batch_s_current_whatever_the_workers() -> None:
    inputs = Inputs.of(Chirp(), samples=2500, interval=2e-4, step=AVERAGED.step)
    plant = Plant.of(THESIS, np.tile(FAULTS, (4, 1)))
    currents = run_batch(AVERAGED, plant, inputs)
    one, two = (observe_batch(AVERAGED, plant, inputs, workers=workers) for workers in (1, 2))
    np.testing.assert_array_equal(one, two)
    np.testing.assert_allclose(one[0], currents, rtol=0, atol=1e-9)


@pytest.mark.parametrize("model", ["averaged", "reference"])
def test_a_hinge_moment_is_held_by_the_motor(model: str) -> None:
    hinge, position = 60.0, 5e-3
    loaded = with_totals(THESIS, {"hinge": hinge, "coulomb": 1e-6, "static": 1e-6})
    held = simulate(loaded, Step(position), model=model, duration=0.5)
    torque = hinge * held["position_rad"][-500:].mean()
    current = held["current_A"][-500:].mean()
    # k i = hinge × position; backlash lets the shaft dither within its gap, to a percent of the torque.
    assert torque == pytest.approx(hinge * position, rel=0.02)
    assert current * THESIS.motor.torque_constant == pytest.approx(torque, rel=0.03)


def test_without_a_hinge_moment_nothing_changes() -> None:
    plain, none = (
        simulate(actuator, Chirp(), faults=Faults(friction=0.3), model="averaged")
        for actuator in (THESIS, with_totals(THESIS, {"hinge": 0.0}))
    )
    np.testing.assert_array_equal(plain["current_A"], none["current_A"])
