"""Optimisers of other libraries keep the contract of `Optimizer`, and their threads never outlive a run."""

import gc
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emaphm.arrays import Array
from emaphm.errors import MethodError
from emaphm.optimizers import minimise
from emaphm.optimizers.adapters import PEERS, Driven, DrivenState, is_peer, peer, peer_names
from emaphm.optimizers.adapters.driven import FAR, Evaluate
from emaphm.optimizers.base import generator

Make = Callable[..., Driven]

NAMES = (*PEERS, "pymoo-ga", "pymoo-de", "pymoo-pso")


def made(name: str, **settings: Any) -> Driven:
    return peer(name)(**settings)


every_peer = pytest.mark.parametrize("make", [partial(made, name) for name in NAMES], ids=NAMES)

CENTRE = 0.2134


def sphere(points: Array) -> Array:
    return np.asarray(np.sum((points - CENTRE) ** 2, axis=1))


def rosenbrock(points: Array) -> Array:
    x, y = points[:, :-1], points[:, 1:]
    return np.asarray(np.sum(100 * (y - x**2) ** 2 + (1 - x) ** 2, axis=1))


def box(dimensions: int) -> dict[str, Array]:
    return {"lower": np.full(dimensions, -2.0), "upper": np.full(dimensions, 2.0)}


def run(
    optimizer: Driven, state: DrivenState, steps: int, fitness: Callable[[Array], Array] = sphere
) -> DrivenState:
    for _ in range(steps):
        state = optimizer.tell(state, fitness(optimizer.ask(state)))
    return state


def assert_same_bits(one: DrivenState, other: DrivenState) -> None:
    for field in fields(one):
        np.testing.assert_array_equal(getattr(one, field.name), getattr(other, field.name), field.name)


def sized(sizes: list[int], fitness: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """Return `fitness` that writes down how many points it is asked for at a time."""

    def counting(points: Array) -> Array:
        sizes.append(len(points))
        return fitness(points)

    return counting


def searches() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "emaphm-search"]


@pytest.fixture(autouse=True)
def no_thread_outlives_its_test() -> Iterator[None]:
    yield
    if searches():
        gc.collect()
    assert not searches()


@every_peer
def test_same_seed_gives_same_bits_and_another_seed_others(make: Make) -> None:
    optimizer = make(**box(3), population=10, iterations=20)
    first, second, third = (run(optimizer, optimizer.init(seed), 12) for seed in (7, 7, 8))
    assert_same_bits(first, second)
    assert not np.array_equal(first.positions, third.positions)


@every_peer
def test_resumed_run_equals_uninterrupted_run(make: Make) -> None:
    optimizer = make(**box(3), population=10, iterations=20)
    halfway = run(optimizer, optimizer.init(3), 9)
    thawed_optimizer, thawed = pickle.loads(pickle.dumps((optimizer, halfway)))  # noqa: S301 - our own bytes
    resumed = run(thawed_optimizer, thawed, 6)
    assert_same_bits(resumed, run(optimizer, halfway, 6))
    assert_same_bits(resumed, run(optimizer, halfway, 6))  # by now without its live search
    assert_same_bits(resumed, run(optimizer, optimizer.init(3), 15))


@every_peer
def test_no_state_is_changed_by_later_steps_or_by_the_caller(make: Make) -> None:
    optimizer = make(**box(3), population=10, iterations=20)
    state = run(optimizer, optimizer.init(3), 5)
    before = pickle.loads(pickle.dumps(state))  # noqa: S301 - our own bytes
    optimizer.ask(state)[:] = 0.0
    run(optimizer, state, 5)
    assert_same_bits(state, before)


@every_peer
@settings(max_examples=8, deadline=None)
@given(
    lower=st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=5),
    width=st.floats(1e-3, 1e3),
    population=st.integers(5, 12),
    seed=st.integers(0, 2**40),
)
def test_points_stay_within_bounds(
    make: Make, lower: list[float], width: float, population: int, seed: int
) -> None:
    low = np.array(lower)
    optimizer = make(lower=low, upper=low + width, population=population, iterations=8)
    state = optimizer.init(seed)
    while not optimizer.finished(state):
        points = optimizer.ask(state)
        assert points.shape == (len(points), low.size)
        assert np.all((points >= low) & (points <= low + width))
        state = optimizer.tell(state, -sphere(points))  # drives the search to the corners
    assert population <= state.evaluations <= optimizer.budget


@every_peer
def test_best_is_the_best_of_all_evaluated_and_each_iteration_is_seen(make: Make) -> None:
    optimizer = make(**box(3), population=10, iterations=30)
    seen: list[Array] = []
    values: list[Array] = []
    states: list[DrivenState] = []

    def fitness(points: Array) -> Array:
        seen.append(points)
        values.append(sphere(points))
        return values[-1]

    result = minimise(optimizer, fitness, seed=1, on_iteration=states.append)
    told = np.concatenate(values)
    best = np.argmin(told)
    assert result.fitness == told[best]
    np.testing.assert_array_equal(result.point, np.concatenate(seen)[best])
    np.testing.assert_array_equal(result.history, np.minimum.accumulate([np.min(v) for v in values]))
    assert result.evaluations == told.size <= optimizer.budget == 300
    assert [state.iteration for state in states] == list(range(1, len(values) + 1))
    np.testing.assert_array_equal(states[-1].told, told)


@every_peer
@pytest.mark.parametrize(("fitness", "share"), [(sphere, 1e-2), (rosenbrock, 1e-1)])
def test_beats_random_search(make: Make, fitness: Callable[[Array], Array], share: float) -> None:
    optimizer = make(**box(4), population=50, iterations=100)
    found = [minimise(optimizer, fitness, seed).fitness for seed in range(3)]
    rng = np.random.default_rng(0)
    at_random = [np.min(fitness(rng.uniform(-2, 2, (5000, 4)))) for _ in range(15)]
    # A search that converges at all gains many decades: two are asked for on the sphere, one in the bent
    # valley, along which a genetic algorithm creeps.
    assert np.median(found) < share * np.median(at_random)


@every_peer
def test_nan_fitness_is_the_worst_fitness(make: Make) -> None:
    optimizer = make(**box(2), population=20, iterations=20)

    def holey(points: Array) -> Array:
        return np.where(points[:, 0] < 0, np.nan, sphere(points))

    with_nan = run(optimizer, optimizer.init(0), 15, holey)
    with_inf = run(optimizer, optimizer.init(0), 15, lambda points: np.nan_to_num(holey(points), nan=np.inf))
    assert_same_bits(with_nan, with_inf)
    assert with_nan.best_point[0] >= 0
    assert with_nan.best_fitness == sphere(with_nan.best_point[None])[0]


@every_peer
def test_survives_a_fitness_that_is_nan_everywhere(make: Make) -> None:
    optimizer = make(**box(2), population=6, iterations=10)
    result = minimise(optimizer, lambda points: np.full(len(points), np.nan), seed=0)
    assert result.fitness == np.inf
    assert np.all(np.abs(result.point) <= 2)


@every_peer
@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"lower": [0, 2]}, r"lower bound \(2\) of component 1 must be less than upper bound \(1\)"),
        ({"upper": [1, np.inf]}, "bounds of component 1 must be finite, got 0 and inf"),
        ({"population": 1}, "population must be at least 2, got 1"),
        ({"iterations": 0}, "iterations must be at least 1, got 0"),
    ],
)
def test_bad_settings_raise(make: Make, bad: dict[str, Any], message: str) -> None:
    with pytest.raises(MethodError, match=message):
        make(**({"lower": np.zeros(2), "upper": np.ones(2)} | bad))


@every_peer
def test_bad_fitness_shape_and_seed_raise(make: Make) -> None:
    optimizer = make(**box(2), population=5)
    state = optimizer.init(0)
    with pytest.raises(MethodError, match=r"shape \(1,\), expected \(5,\)"):
        optimizer.tell(state, np.zeros(1))
    with pytest.raises(MethodError, match="seed must be at least 0, got -1"):
        optimizer.init(-1)
    optimizer.tell(state, np.zeros(5))  # the state is as good as before


@pytest.mark.parametrize("name", [name for name in NAMES if name != "cma-es"])
def test_one_component_can_be_searched(name: str) -> None:
    result = minimise(peer(name)(**box(1), population=10, iterations=30), sphere, 0)
    assert abs(result.point[0] - CENTRE) < 4 / 300  # as close as a grid of as many points


def test_cma_es_refuses_one_component() -> None:
    with pytest.raises(MethodError, match="'cma-es' needs at least 2 components to search in, got 1"):
        peer("cma-es")(**box(1))


@pytest.mark.parametrize(
    ("name", "population", "message"),
    [
        ("l-shade", 3, "population must be at least 4 for 'l-shade', got 3"),
        ("scipy-de", 4, "population must be at least 5 for 'scipy-de', got 4"),
    ],
)
def test_populations_too_small_for_the_library_are_refused(name: str, population: int, message: str) -> None:
    with pytest.raises(MethodError, match=message):
        peer(name)(**box(2), population=population)
    assert minimise(peer(name)(**box(2), population=population + 1, iterations=9), sphere, 0).evaluations > 0


@pytest.mark.parametrize("name", [*NAMES, "pymoo-cmaes"])
def test_global_random_numbers_are_left_alone(name: str) -> None:
    def global_numbers() -> list[Any]:
        return [np.array(part).tolist() for part in np.random.get_state()]  # noqa: NPY002 - what is tested

    before = global_numbers()
    optimizer = peer(name)(**box(2), population=10, iterations=10)
    state = optimizer.init(0)
    assert global_numbers() == before
    while not optimizer.finished(state):
        np.random.random()  # noqa: NPY002 - a caller who uses them too must not steer the search
        before = global_numbers()
        state = optimizer.tell(state, sphere(optimizer.ask(state)))
        assert global_numbers() == before
    undisturbed = minimise(optimizer, sphere, 0)
    np.testing.assert_array_equal(undisturbed.point, state.best_point)


@pytest.mark.parametrize("name", [*NAMES, "pymoo-cmaes"])
def test_runs_side_by_side_do_not_disturb_each_other(name: str) -> None:
    optimizer = peer(name)(**box(3), population=10, iterations=12)
    alone = [run(optimizer, optimizer.init(seed), 8) for seed in range(4)]
    together = [optimizer.init(seed) for seed in range(4)]
    for _ in range(8):
        together = [run(optimizer, state, 1) for state in together]
    with ThreadPoolExecutor(4) as pool:
        threaded = list(pool.map(lambda seed: run(optimizer, optimizer.init(seed), 8), range(4)))
    for states in zip(alone, together, threaded, strict=True):
        assert_same_bits(states[0], states[1])
        assert_same_bits(states[0], states[2])


@every_peer
def test_threads_end_with_their_run_state_or_optimiser(make: Make) -> None:
    optimizer = make(**box(3), population=10, iterations=5)
    minimise(optimizer, sphere, 0)
    assert not searches()
    state = run(optimizer, optimizer.init(0), 2)
    assert len(searches()) == 1
    del state
    gc.collect()
    assert not searches()
    kept = run(optimizer, optimizer.init(0), 2)
    assert len(searches()) == 1
    del optimizer
    gc.collect()
    assert not searches()
    assert_same_bits(
        run(make(**box(3), population=10, iterations=5), kept, 1),
        run(fresh := make(**box(3), population=10, iterations=5), fresh.init(0), 3),
    )


def test_exceptions_through_compiled_code_do_no_harm() -> None:
    optimizer = peer("l-shade")(**box(3), population=10, iterations=20)
    for seed in range(60):
        run(optimizer, optimizer.init(seed), seed % 7)  # abandoned there and then
    gc.collect()
    assert not searches()
    # The best of 200 random points has a median of (ln 2 · 64/200 · 3/4π)^(2/3) = 0.14.
    assert minimise(optimizer, sphere, 0).fitness < 0.014


def test_l_shade_leaves_no_memory_behind() -> None:
    from minionpy.algorithms import LSHADE

    def left() -> int:
        gc.collect()
        return sum(type(thing) is LSHADE for thing in gc.get_objects())

    optimizer = peer("l-shade")(**box(3), population=10, iterations=5)
    before = left()
    minimise(optimizer, sphere, 0)
    run(optimizer, optimizer.init(1), 2)
    assert left() == before


@every_peer
def test_a_run_goes_on_when_its_thread_is_gone(make: Make) -> None:
    optimizer = make(**box(3), population=10, iterations=9)
    state = run(optimizer, optimizer.init(0), 3)
    optimizer._live[state].end()  # as in a process forked from the one that has the thread
    assert_same_bits(run(optimizer, state, 2), run(optimizer, optimizer.init(0), 5))


def test_interpreter_exits_cleanly_amid_runs_and_imports_no_library_before_use() -> None:
    script = f"""
import sys
import emaphm, emaphm.optimizers
from emaphm.optimizers.adapters import peer
assert not {{"cma", "minionpy", "pymoo"}} & set(sys.modules)
made = [peer(name)(lower=[0, 0], upper=[1, 1]) for name in {NAMES}]
states = [optimizer.init(0) for optimizer in made]
print(len(states))
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)  # noqa: S603
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{len(NAMES)}\n", "")


@pytest.mark.parametrize(
    ("name", "library"),
    [("cma-es", "cma"), ("l-shade", "minionpy"), ("pymoo-ga", "pymoo")],
)
def test_a_missing_library_is_named(monkeypatch: pytest.MonkeyPatch, name: str, library: str) -> None:
    state = peer(name)(**box(2), population=10).init(0)
    frozen = pickle.dumps((peer(name)(**box(2), population=10), state))
    monkeypatch.setitem(sys.modules, library, None)  # makes its import fail
    message = f"method '{name}' needs the library '{library}'; install it with: pip install 'emaphm[peers]'"
    with pytest.raises(MethodError) as caught:
        peer(name)(**box(2), population=10)
    assert str(caught.value) == message
    thawed, state = pickle.loads(frozen)  # noqa: S301 - our own bytes, taken to a computer without the library
    with pytest.raises(MethodError) as caught:
        thawed.tell(state, np.zeros(10))
    assert str(caught.value) == message


def test_without_pymoo_the_others_are_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pymoo", None)
    assert peer_names() == ("cma-es", "l-shade", "scipy-de")


def test_a_library_that_is_broken_is_not_called_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in [name for name in sys.modules if name == "cma" or name.startswith("cma.")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "cma.sampler", None)
    with pytest.raises(ImportError, match=r"cma\.sampler"):
        peer("cma-es")(**box(2))


def test_all_names_can_be_made_run_and_repeated() -> None:
    names = peer_names()
    assert set(NAMES) | {"pymoo-cmaes", "pymoo-nelder-mead", "pymoo-es"} <= set(names)
    for name in names:
        assert is_peer(name)
        optimizer = peer(name)(**box(2), population=20, iterations=6)
        one, other = (minimise(optimizer, sphere, seed) for seed in (5, 5))
        assert one.fitness < 1, name  # random points have a mean of 2.8
        np.testing.assert_array_equal(one.history, other.history, name)
        assert one.evaluations <= 120, name


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("cma", r"unknown method 'cma' \(did you mean 'cma-es'\?\)"),
        ("pymoo-gaa", r"unknown method 'pymoo-gaa' \(did you mean 'pymoo-ga'\?\)"),
        ("pymoo-nelder", r"did you mean 'pymoo-nelder-mead'\?"),
    ],
)
def test_misspelt_names_are_answered_with_the_nearest(name: str, message: str) -> None:
    with pytest.raises(MethodError, match=message):
        peer(name)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("pymoo-bga", "method 'pymoo-bga' cannot be used: it does not search real numbers; choose another"),
        ("pymoo-brkga", "method 'pymoo-brkga' cannot be used: with population 50 pymoo says '.*pop_size"),
        ("pymoo-pattern-search", "cannot be used: pymoo does not repeat its search from a seed"),
    ],
)
def test_algorithms_that_do_not_fit_are_refused_and_not_listed(name: str, message: str) -> None:
    with pytest.raises(MethodError, match=message):
        peer(name)(**box(3))
    assert name not in peer_names()


def test_neither_unknown_settings_nor_another_algorithm_pass() -> None:
    with pytest.raises(TypeError):
        peer("pymoo-ga")(**box(2), algorithm="de")


def test_l_shade_shrinks_as_published() -> None:
    optimizer = peer("l-shade")(**box(8), population=144, iterations=50)
    sizes: list[int] = []
    minimise(optimizer, sized(sizes, rosenbrock), seed=0)
    evaluated = np.cumsum(sizes)
    # Tanabe & Fukunaga (2014), equation 10, from the evaluations before each generation. The library
    # rounds down where the paper rounds to the nearest.
    published = (4 - 144) / optimizer.budget * evaluated[:-2] + 144
    assert sizes[0] == 144
    assert np.all(np.abs(sizes[1:-1] - published) <= 1)
    assert sizes[-2] <= 5
    assert evaluated[-1] == optimizer.budget


def test_cma_es_starts_in_the_middle_and_restarts_with_twice_the_population() -> None:
    optimizer = peer("cma-es")(**box(3), population=10, iterations=400)
    sizes: list[int] = []
    first = optimizer.init(0).positions
    # Standard error of the mean of 10 points is 0.25 * 4 / sqrt(10) = 0.32; three of them.
    assert np.all(np.abs(first.mean(axis=0)) < 0.96)
    result = minimise(optimizer, sized(sizes, sphere), seed=0)
    assert set(sizes[:-1]) >= {10, 20, 40}
    assert sizes[:-1] == sorted(sizes[:-1])
    assert all(size in 10 * 2 ** np.arange(9) for size in sizes[:-1])
    assert result.evaluations == optimizer.budget


def test_scipy_finds_the_same_by_itself() -> None:
    from scipy.optimize import Bounds, differential_evolution
    from scipy.stats import qmc

    found = minimise(peer("scipy-de")(**box(3), population=30, iterations=41), rosenbrock, seed=6)
    rng = generator(6, 0)
    start = qmc.LatinHypercube(3, seed=rng).random(30) * 4 - 2

    def fitness(columns: Array, *_: Any) -> Any:
        return rosenbrock(columns.T)

    alone = differential_evolution(
        fitness, bounds=Bounds([-2.0] * 3, [2.0] * 3), init=start, maxiter=40, seed=rng,
        vectorized=True, updating="deferred", polish=False,
    )  # fmt: skip
    assert found.fitness == pytest.approx(alone.fun, rel=1e-6)  # both round on their way from the unit cube
    np.testing.assert_allclose(found.point, alone.x, rtol=1e-6)


@pytest.mark.parametrize("name", ["ga", "de", "pso"])
def test_pymoo_finds_the_same_by_itself(name: str) -> None:
    from pymoo.core.problem import Problem
    from pymoo.optimize import minimize

    from emaphm.optimizers.adapters.pymoo_algorithms import pymoo_algorithms

    class Valley(Problem):  # type: ignore[misc]
        def _evaluate(self, x: Array, out: dict[str, Array], *_: object) -> None:
            out["F"] = rosenbrock(x)

    found = minimise(peer(f"pymoo-{name}")(**box(3), population=20, iterations=15), rosenbrock, seed=6)
    alone = minimize(
        Valley(n_var=3, xl=-2.0, xu=2.0),
        pymoo_algorithms()[name](pop_size=20),
        ("n_eval", 300),
        seed=int(generator(6, 0).integers(1, 2**31)),
    )
    assert found.fitness == pytest.approx(alone.F[0], rel=1e-6)
    np.testing.assert_allclose(found.point, alone.X, rtol=1e-6)


def test_l_shade_finds_the_same_by_itself() -> None:
    from minionpy.algorithms import LSHADE

    found = minimise(peer("l-shade")(**box(3), population=20, iterations=60), rosenbrock, seed=6)
    alone = LSHADE(
        lambda rows: rosenbrock(np.array(rows) * 4 - 2).tolist(),
        [(0.0, 1.0)] * 3, maxevals=1200, seed=int(generator(6, 0).integers(2**31)),
        options={"population_size": 20},
    ).optimize()  # fmt: skip
    # The library's last generation may pass the budget, where the adapter's is cut.
    assert found.fitness == pytest.approx(alone.fun, rel=1e-6)


@dataclass(frozen=True, eq=False)
class Scripted(Driven):
    """A library whose loop is given by the test."""

    loop: Callable[[Evaluate, np.random.Generator], object] = print

    method = "scripted"

    def _drive(self, evaluate: Evaluate, rng: np.random.Generator) -> None:
        self.loop(evaluate, rng)


def scripted(loop: Callable[[Evaluate, np.random.Generator], object], **budget: int) -> Scripted:
    budget = {"population": 4, "iterations": 5} | budget
    return Scripted(**box(2), **budget, loop=loop)  # type: ignore[arg-type]


def test_errors_of_the_library_surface() -> None:
    def fails(evaluate: Evaluate, rng: np.random.Generator) -> None:
        evaluate(rng.random((4, 2)))
        raise ZeroDivisionError("the library's own")

    optimizer = scripted(fails)
    state = optimizer.init(0)
    for _ in range(2):  # told again, the state is led back and fails again
        with pytest.raises(ZeroDivisionError, match="the library's own"):
            run(optimizer, state, 1)
    with pytest.raises(ZeroDivisionError):
        scripted(lambda *_: 1 // 0).init(0)


def test_a_library_that_swallows_exceptions_ends_too() -> None:
    def stubborn(evaluate: Evaluate, rng: np.random.Generator) -> None:
        for _ in range(3):
            try:
                evaluate(rng.random((4, 2)))
            except BaseException:  # noqa: BLE001, S112 - what is tested
                continue
        raise ValueError("as a library turns one error into another")

    optimizer = scripted(stubborn)
    state = optimizer.init(0)
    assert len(searches()) == 1
    del state
    gc.collect()
    assert not searches()


def test_a_library_that_ends_early_has_finished() -> None:
    optimizer = scripted(lambda evaluate, rng: [evaluate(rng.random((3, 2))) for _ in range(2)])
    result = minimise(optimizer, sphere, 0)
    assert (result.evaluations, result.history.size) == (6, 2)
    state = run(optimizer, optimizer.init(0), 2)
    assert optimizer.finished(state)
    assert optimizer.ask(state).shape == (0, 2)
    with pytest.raises(MethodError, match="'scripted' has finished after 6 evaluations"):
        optimizer.tell(state, [])


def test_a_library_that_asks_for_nothing_has_finished_at_once() -> None:
    result = minimise(scripted(lambda evaluate, _: evaluate(np.empty((0, 2)))), sphere, 0)
    assert (result.evaluations, result.fitness) == (0, np.inf)


def test_the_budget_cuts_the_last_population_and_ends_the_library() -> None:
    told: list[int] = []

    def grows(evaluate: Evaluate, rng: np.random.Generator) -> None:
        told.extend(len(evaluate(rng.random((size, 2)))) for size in range(1, 100))

    optimizer = scripted(grows)
    sizes: list[int] = []
    result = minimise(optimizer, sized(sizes, sphere), 0)
    assert sizes == [1, 2, 3, 4, 5, 5]
    assert result.evaluations == optimizer.budget == 20
    assert told == [1, 2, 3, 4, 5]
    assert not searches()


def test_the_library_hears_finite_fitness_and_the_result_the_true_one() -> None:
    heard: list[Array] = []
    optimizer = scripted(lambda evaluate, rng: heard.append(evaluate(rng.random((4, 2)))), iterations=2)
    state = optimizer.tell(optimizer.init(0), [np.nan, np.inf, -np.inf, 2.5])
    np.testing.assert_array_equal(heard, [[FAR, FAR, -FAR, 2.5]])
    np.testing.assert_array_equal(state.told, [np.inf, np.inf, -np.inf, 2.5])
    assert np.isfinite(np.std([FAR, -FAR]))  # even libraries that square it


@pytest.mark.parametrize("outside", [1.001, -0.001, np.nan])
def test_a_library_that_leaves_the_bounds_is_stopped(outside: float) -> None:
    with pytest.raises(MethodError, match="points outside the bounds"):
        scripted(lambda evaluate, _: evaluate(np.array([[0.5, outside]]))).init(0)


def test_rounding_of_the_library_is_brought_back_to_the_bounds() -> None:
    state = scripted(lambda evaluate, _: evaluate(np.array([[1 + 1e-15, -1e-15]]))).init(0)
    np.testing.assert_array_equal(state.positions, [[2, -2]])


def test_a_state_of_another_search_is_refused() -> None:
    optimizer = scripted(lambda evaluate, rng: [evaluate(rng.random((4, 2))) for _ in range(5)])
    state = run(optimizer, optimizer.init(0), 2)
    with pytest.raises(MethodError, match="'scripted' does not come to this state again"):
        run(optimizer, replace(state, seed=1), 1)
    stops = scripted(lambda evaluate, rng: evaluate(rng.random((4, 2))))
    with pytest.raises(MethodError, match="does not come to this state again"):
        run(stops, state, 1)
