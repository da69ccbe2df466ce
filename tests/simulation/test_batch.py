"""A batch equals its single runs: lanes are independent of each other and of the number of threads."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from emaphm import threads
from emaphm.actuator import Chirp, Sine
from emaphm.simulation import (
    AVERAGED,
    MODELS,
    REFERENCE,
    Inputs,
    Model,
    Plant,
    run,
    simulate_batch,
)
from emaphm.simulation.engine import running
from emaphm.simulation.engine.running import LANES
from simulation.rig import INTERVAL, SHORTED, THESIS, currents, rms

EACH_MODEL = pytest.mark.parametrize("model", MODELS.values(), ids=list(MODELS))
DRAWN = np.random.default_rng(33).random((33, 8)) * SHORTED


def inputs(model: Model, samples: int = 250) -> Inputs:
    return Inputs.of(Sine(8e-3, 15.0), 0.02, samples=samples, interval=INTERVAL, step=model.step)


@EACH_MODEL
def test_a_batch_equals_its_single_runs(model: Model) -> None:
    batch = simulate_batch(model, THESIS, DRAWN[:3], inputs(model))
    single = [run(model, Plant.of(THESIS, k), inputs(model))["current_A"] for k in DRAWN[:3]]
    if model is AVERAGED:
        np.testing.assert_allclose(batch, single, rtol=1e-9, atol=1e-9)
        return
    # Vector and scalar instructions may round differently, and switching is chaotic: 0.2 A in some lanes,
    # twice the effect of half the step (docs/physics.md, section 3). Before any leg switches they agree.
    assert np.all(rms(batch - np.array(single)) < 0.2)
    np.testing.assert_allclose(batch[:, :10], np.array(single)[:, :10], rtol=0, atol=1e-9)


@EACH_MODEL
@pytest.mark.parametrize("rows", [1, LANES - 1, LANES, LANES + 1, 33])
def test_any_number_of_rows_gives_the_same_bits(model: Model, rows: int) -> None:
    all_currents = simulate_batch(model, THESIS, DRAWN, inputs(model, 50))
    some_currents = simulate_batch(model, THESIS, DRAWN[:rows], inputs(model, 50))
    assert some_currents.shape == (rows, 50)
    assert np.array_equal(some_currents, all_currents[:rows])


@pytest.mark.parametrize("name", ["integral_gain", "derivative_gain", "speed_lag", "torque_lag", "hinge"])
def test_a_term_that_is_0_for_all_lanes_equals_a_term_omitted_by_the_kernel(name: str) -> None:
    driven = inputs(AVERAGED, 100)
    three = Plant.of(THESIS, DRAWN[:3])
    four = Plant.of(THESIS, DRAWN[:4], {name: [0.0, 0.0, 0.0, 1e-3]})
    without_term, with_term = currents(AVERAGED, three, driven), currents(AVERAGED, four, driven)
    # Compiled without the term, and with it at 0.
    np.testing.assert_allclose(with_term[:3], without_term, rtol=1e-9, atol=1e-9)
    assert rms(with_term[3] - currents(AVERAGED, Plant.of(THESIS, DRAWN[3:4]), driven)[0]) > 1e-6


@EACH_MODEL
def test_permuted_rows_give_permuted_bits(model: Model) -> None:
    order = np.random.default_rng(1).permutation(33)
    straight = simulate_batch(model, THESIS, DRAWN, inputs(model, 50))
    assert np.array_equal(simulate_batch(model, THESIS, DRAWN[order], inputs(model, 50)), straight[order])
    assert len(np.unique(straight, axis=0)) == 33  # otherwise the test would be void


@EACH_MODEL
def test_the_number_of_workers_changes_no_bit(model: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    pools: list[int] = []

    class Counted(ThreadPoolExecutor):
        def __init__(self, workers: int) -> None:
            pools.append(workers)
            super().__init__(workers)

    monkeypatch.setattr(threads, "ThreadPoolExecutor", Counted)
    monkeypatch.setattr(running, "WORTH_A_THREAD", 0)
    one, two, three = (
        simulate_batch(model, THESIS, DRAWN, inputs(model, 50), workers=workers) for workers in (1, 2, 3)
    )
    assert pools == [2, 3]
    assert np.array_equal(one, two)
    assert np.array_equal(one, three)


def test_repeated_runs_give_the_same_bits_and_do_not_change_their_arguments() -> None:
    plant, given = Plant.of(THESIS, DRAWN), inputs(REFERENCE, 50)
    copies = plant.turns.copy(), given.command.copy()
    first = currents(REFERENCE, plant, given)
    assert np.array_equal(currents(REFERENCE, plant, given), first)
    assert np.array_equal(plant.turns, copies[0])
    assert np.array_equal(given.command, copies[1])


def test_a_batch_without_rows_has_no_rows() -> None:
    assert simulate_batch(AVERAGED, THESIS, np.empty((0, 8)), inputs(AVERAGED)).shape == (0, 250)


def test_lumped_parameters_may_differ_between_rows() -> None:
    masses = np.array([1e-5, 2.5e-5, 5e-5])
    given = Inputs.of(Chirp(), samples=500, interval=INTERVAL, step=AVERAGED.step)
    batch = currents(AVERAGED, Plant.of(THESIS, np.tile(DRAWN[0], (3, 1)), {"inertia": masses}), given)
    for row, inertia in zip(batch, masses, strict=True):
        alone = currents(AVERAGED, Plant.of(THESIS, DRAWN[0], {"inertia": inertia}), given)[0]
        assert np.array_equal(row, alone)
    assert rms(batch[0] - batch[2]) > 0.1
