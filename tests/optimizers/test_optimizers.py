"""All listed optimisers against the contract of `Optimizer`."""

import math
import pickle
from collections.abc import Callable
from dataclasses import fields
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emaphm.arrays import Array
from emaphm.errors import MethodError, SignalError
from emaphm.optimizers import OPTIMIZERS, BestSoFar, Dragonfly, Optimizer, State
from optimizers.functions import box, sphere

Make = Callable[..., Optimizer[Any]]

MAKERS: dict[str, Make] = {
    **OPTIMIZERS,
    "dragonfly-thesis": partial(Dragonfly, variant="thesis"),
    "dragonfly-quadratic": partial(Dragonfly, growth="quadratic"),
}
every_optimizer = pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS.keys())
every_optimizer_but_random = pytest.mark.parametrize(
    "make", [pytest.param(make, id=name) for name, make in MAKERS.items() if name != "random"]
)


def run(
    optimizer: Optimizer[Any], state: State, iterations: int, fitness: Callable[[Array], Array] = sphere
) -> State:
    for _ in range(iterations):
        state = optimizer.tell(state, fitness(optimizer.ask(state)))
    return state


def assert_same_bits(first: State, second: State) -> None:
    for field in fields(first):
        np.testing.assert_array_equal(getattr(first, field.name), getattr(second, field.name), field.name)


@every_optimizer
def test_the_seed_determines_the_bits(make: Make) -> None:
    optimizer = make(*box(3), population=10, iterations=20)
    first, second, third = (run(optimizer, optimizer.init(seed), 20) for seed in (7, 7, 8))
    assert_same_bits(first, second)
    assert not np.array_equal(first.positions, third.positions)


@every_optimizer
def test_a_resumed_run_equals_an_uninterrupted_run(make: Make) -> None:
    optimizer = make(*box(3), population=10, iterations=20)
    halfway = run(optimizer, optimizer.init(3), 9)
    thawed_optimizer, thawed = pickle.loads(pickle.dumps((optimizer, halfway)))  # noqa: S301 - our own bytes
    resumed = run(thawed_optimizer, thawed, 11)
    assert_same_bits(resumed, run(optimizer, halfway, 11))
    assert_same_bits(resumed, run(optimizer, optimizer.init(3), 20))


@every_optimizer
def test_later_steps_and_the_caller_do_not_change_a_state(make: Make) -> None:
    optimizer = make(*box(3), population=10, iterations=20)
    state = run(optimizer, optimizer.init(3), 5)
    before = pickle.loads(pickle.dumps(state))  # noqa: S301 - our own bytes
    optimizer.ask(state)[:] = 0.0
    run(optimizer, state, 5)
    assert_same_bits(state, before)


@every_optimizer
@settings(max_examples=25, deadline=None)
@given(
    lower=st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=5),
    width=st.floats(1e-3, 1e3),
    population=st.integers(4, 12),
    seed=st.integers(0, 2**32),
)
def test_points_stay_within_bounds(
    make: Make, lower: list[float], width: float, population: int, seed: int
) -> None:
    low = np.array(lower)
    optimizer = make(low, low + width, population=population, iterations=8)
    state = optimizer.init(seed)
    for _ in range(8):
        points = optimizer.ask(state)
        assert points.shape == (population, low.size)
        assert np.all((points >= low) & (points <= low + width))
        state = optimizer.tell(state, -sphere(points))  # drives the swarm to the corners


@every_optimizer
def test_the_result_is_the_best_of_all_evaluated_points(make: Make) -> None:
    optimizer = make(*box(3), population=10, iterations=30)
    evaluated: list[Array] = []
    values: list[Array] = []

    def fitness(points: Array) -> Array:
        evaluated.append(points)
        values.append(sphere(points))
        return values[-1]

    result = optimizer.minimise(fitness, seed=1)
    best = np.argmin(np.concatenate(values))
    assert result.fitness == np.concatenate(values)[best]
    np.testing.assert_array_equal(result.point, np.concatenate(evaluated)[best])
    np.testing.assert_array_equal(result.history, np.minimum.accumulate(np.min(values, axis=1)))
    assert result.evaluations == np.concatenate(values).size == 300


@every_optimizer_but_random
@pytest.mark.parametrize("dimensions", [2, 3])
def test_beats_random_search_on_a_sphere(make: Make, dimensions: int) -> None:
    optimizer = make(*box(dimensions), population=50, iterations=100)
    reached = [optimizer.minimise(sphere, seed).fitness for seed in range(5)]
    # The nearest of m uniform points has a median squared distance r² with m V(r) = ln 2, V the volume
    # of the ball in units of the box: a closed form for random search with the same evaluations.
    unit_ball = math.pi ** (dimensions / 2) / math.gamma(dimensions / 2 + 1)
    random_search = (math.log(2) / 5000 * 2**dimensions / unit_ball) ** (2 / dimensions)
    # A converging population gains many decades; 1e-2 requires two, in the median of 5 runs.
    assert np.median(reached) < 1e-2 * random_search


@every_optimizer
def test_nan_fitness_is_the_worst_fitness(make: Make) -> None:
    optimizer = make(*box(2), population=20, iterations=30)

    def partly_nan(points: Array) -> Array:
        return np.where(points[:, 0] < 0, np.nan, sphere(points))

    with_nan = run(optimizer, optimizer.init(0), 30, partly_nan)
    with_inf = run(
        optimizer, optimizer.init(0), 30, lambda points: np.nan_to_num(partly_nan(points), nan=np.inf)
    )
    assert_same_bits(with_nan, with_inf)
    assert with_nan.best_point[0] >= 0
    assert with_nan.best_fitness == sphere(with_nan.best_point[None])[0]


@every_optimizer
def test_a_fitness_that_is_nan_everywhere_gives_an_infinite_result(make: Make) -> None:
    optimizer = make(*box(2), population=5, iterations=10)
    result = optimizer.minimise(lambda points: np.full(len(points), np.nan), seed=0)
    assert result.fitness == np.inf
    assert np.all(np.abs(result.point) <= 1)


@every_optimizer
def test_the_callback_receives_each_population(make: Make) -> None:
    recorded: list[Array] = []
    reports: list[BestSoFar] = []

    def fitness(points: Array) -> Array:
        recorded.append(sphere(points))
        return recorded[-1]

    result = make(*box(2), population=5, iterations=4).minimise(fitness, 0, reports.append)
    assert [report.evaluations for report in reports] == [5, 10, 15, 20]
    least = np.minimum.accumulate([np.min(values) for values in recorded])
    np.testing.assert_array_equal([report.best_fitness for report in reports], least)
    np.testing.assert_array_equal([sphere(report.best_point[np.newaxis])[0] for report in reports], least)
    np.testing.assert_array_equal(result.history, least)


@every_optimizer
def test_random_numbers_differ_from_those_of_a_plain_generator(make: Make) -> None:
    start = make(np.zeros(8), np.ones(8), population=5).init(4).positions
    plain = [np.random.default_rng(entropy).random((5, 8)) for entropy in (4, (4, 0))]
    assert not any(np.isin(start, numbers).any() for numbers in plain)


@every_optimizer
@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"lower": [0, 2]}, r"lower bound \(2\) of component 1 must be less than upper bound \(1\)"),
        ({"upper": [0, 1]}, r"lower bound \(0\) of component 0 must be less than upper bound \(0\)"),
        ({"upper": [np.nan, 1]}, "component 0 must be less"),
        ({"upper": [1, np.inf]}, "bounds of component 1 must be finite, got 0 and inf"),
        ({"upper": [1, 1, 1]}, r"vectors of one length, got shapes \(2,\) and \(3,\)"),
        ({"population": 1}, r"population must be at least \d, got 1"),
        ({"iterations": 0}, "iterations must be at least 1, got 0"),
        ({"population": 4.5}, "population must be a whole number, got 4.5"),
        ({"iterations": True}, "iterations must be a whole number, got True"),
    ],
)
def test_invalid_settings_are_refused(make: Make, bad: dict[str, Any], message: str) -> None:
    with pytest.raises(MethodError, match=message):
        make(**({"lower": np.zeros(2), "upper": np.ones(2)} | bad))


@every_optimizer
def test_a_wrong_shape_of_fitness_and_a_negative_seed_are_refused(make: Make) -> None:
    optimizer = make(*box(2), population=5)
    with pytest.raises(MethodError, match=r"shape \(4,\), expected \(5,\)"):
        optimizer.tell(optimizer.init(0), np.zeros(4))
    with pytest.raises(SignalError, match="seed -1 is negative"):
        optimizer.init(-1)
